"""The example log: what is shipped is what the script makes, and SLAM on it finds the way."""

from __future__ import annotations

import gzip
import math
import sys
from pathlib import Path

import numpy as np
import pytest

from mapmeld.io.scans import open_scans
from mapmeld.se2 import Pose2
from mapmeld.slam import GMapping, GMappingParameters

EXAMPLES = Path(__file__).parents[2] / "examples"
sys.path.insert(0, str(EXAMPLES))  # as when the script is run

import make_slam_log  # noqa: E402

SHIPPED = EXAMPLES / "slam"


def test_what_is_shipped_is_what_the_script_makes(tmp_path: Path) -> None:
    assert make_slam_log.main(["--out", str(tmp_path)]) == 0
    made = gzip.decompress((tmp_path / "office.log.gz").read_bytes()).decode().splitlines()
    shipped = gzip.decompress((SHIPPED / "office.log.gz").read_bytes()).decode().splitlines()
    assert len(made) == len(shipped)
    # As numbers, and nearly all: rounding, and so which cell a ray meets, is not the same on every processor.
    for ours, theirs in zip(made[1::50], shipped[1::50], strict=True):
        one, other = (np.array(line.split()[1:-2], float) for line in (ours, theirs))
        assert np.mean(np.abs(one - other) < 0.02) > 0.99
    assert (SHIPPED / "office.log.gz").stat().st_size < 300_000


def test_odometry_drifts_and_slam_does_not() -> None:
    stream = open_scans(SHIPPED / "office.log.gz")
    scans = list(stream.scans)
    assert not stream.left_out
    truth = np.loadtxt(SHIPPED / "truth.txt")
    assert len(scans) == len(truth)
    slam = GMapping(
        stream.laser, GMappingParameters(particles=5, linearUpdate=0.3, angularUpdate=0.25, lskip=1)
    )
    for scan in scans:
        slam.add(scan)
    T_world_map = Pose2(*truth[0, 1:])
    found = slam.trajectory()
    used = np.searchsorted(truth[:, 0], found.stamps - 1e-6)
    true = truth[used, 1:3]
    believed = np.array([(scans[i].T_odom_base.x, scans[i].T_odom_base.y) for i in used])

    def rms(points: np.ndarray) -> float:
        return math.sqrt(float(np.square(T_world_map.apply(points) - true).sum(axis=1).mean()))

    assert rms(believed) > 0.5
    assert rms(found.poses[:, :2]) < 0.25


def test_refuses_to_overwrite(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "truth.txt").write_text("mine")
    assert make_slam_log.main(["--out", str(tmp_path)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert (tmp_path / "truth.txt").read_text() == "mine"
