"""CARMEN logs: both kinds of lines, and what is wrong with logs."""

from __future__ import annotations

import gzip
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.errors import MapmeldError
from mapmeld.io.carmen import carmen_scans
from mapmeld.io.scan_stream import ScanFileError
from mapmeld.io.scans import open_scans
from mapmeld.se2 import Pose2

FLASER = "FLASER 3 1.00 2.50 81.91 9 9 9 0.5 0.25 0.1 {time} host 12.0\n"
ROBOTLASER = (
    "ROBOTLASER1 0 -1.0 2.0 1.0 20.0 0.01 0 3 1.0 2.0 30.0 0 "
    "0.3 0.0 0.0 0.2 0.0 0.0 0 0 0 0 0 {time} host 12.0\n"
)


def written(tmp_path: Path, text: str | bytes, name: str = "log.txt") -> Path:
    path = tmp_path / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def test_flaser_lines_look_ahead_over_half_a_circle(tmp_path: Path) -> None:
    log = "# CARMEN\nPARAM robot_front_laser_max 40.0 host 0\nPARAM robot_frontlaser_offset 0.15 host 0\n"
    log += "ODOM 1 2 3 0 0 0 5.0 host 5.0\n" + FLASER.format(time=10.0) + FLASER.format(time=10.5)
    stream = open_scans(written(tmp_path, log))
    assert stream.laser.beams == 3
    np.testing.assert_allclose(stream.laser.bearings(), (-math.pi / 2, 0, math.pi / 2))
    assert stream.laser.max_range == 40.0
    assert stream.laser.T_base_laser == Pose2(0.15)
    scans = list(stream.scans)
    assert [scan.stamp for scan in scans] == [10.0, 10.5]
    assert scans[0].T_odom_base == Pose2(0.5, 0.25, 0.1)  # the robot's odometry, not the laser's pose
    assert scans[0].ranges.dtype == np.float32
    np.testing.assert_allclose(scans[0].ranges, (1, 2.5, 81.91))
    assert not stream.left_out


@pytest.mark.parametrize(("beams", "step"), [(180, 1.0), (181, 1.0), (360, 0.5), (361, 0.5), (1, 180.0)])
def test_flaser_lines_of_known_lasers_have_their_resolution(tmp_path: Path, beams: int, step: float) -> None:
    log = f"FLASER {beams} {'1.0 ' * beams} 0 0 0 0 0 0 1.0 host 1.0\n"
    laser = carmen_scans(written(tmp_path, log)).laser
    assert math.degrees(laser.step) == pytest.approx(step)
    assert laser.max_range == 80.0


def test_robotlaser_lines_say_all_themselves(tmp_path: Path) -> None:
    stream = carmen_scans(written(tmp_path, ROBOTLASER.format(time=3.5)))
    laser = stream.laser
    assert (laser.beams, laser.first_angle, laser.step, laser.max_range) == (3, -1.0, 1.0, 20.0)
    assert laser.T_base_laser.distance_to(Pose2(0.1)) == pytest.approx((0, 0))
    (scan,) = stream.scans
    assert (scan.stamp, scan.T_odom_base) == (3.5, Pose2(0.2))


def test_a_laser_pose_far_from_the_robot_is_no_mount(tmp_path: Path) -> None:
    log = ROBOTLASER.format(time=3.5).replace(" 0.3 0.0 0.0 0.2", " 7.3 0.0 0.0 0.2")
    assert carmen_scans(written(tmp_path, log)).laser.T_base_laser == Pose2()


def test_the_first_kind_of_line_is_the_one_that_is_read(tmp_path: Path) -> None:
    log = ROBOTLASER.format(time=1.0) + FLASER.format(time=1.0) + ROBOTLASER.format(time=2.0)
    stream = carmen_scans(written(tmp_path, log))
    assert [scan.stamp for scan in stream.scans] == [1.0, 2.0]


def test_packed_logs_are_read_whatever_they_are_called(tmp_path: Path) -> None:
    packed = gzip.compress(FLASER.format(time=1.0).encode())
    assert len(list(open_scans(written(tmp_path, packed, "odd name")).scans)) == 1


def test_what_does_not_fit_is_passed_over_and_counted(tmp_path: Path) -> None:
    other = "FLASER 2 1.0 1.0 0 0 0 0 0 0 3.0 host 3.0\n"
    log = "".join(FLASER.format(time=time) for time in (1.5, 2.0, 1.0)) + other + FLASER.format(time=4.0)
    stream = carmen_scans(written(tmp_path, log + "FLASER 3 1.0 2."))
    assert [scan.stamp for scan in stream.scans] == [1.5, 2.0, 4.0]
    assert stream.left_out == {
        "a scan that is older than the one before it": 1,
        "a scan that has not 3 beams, as the first one has": 1,
        "a last line that is cut off": 1,
    }


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("FLASER 3 1.0 2.0\n", "line 2 is no FLASER line: it says 3 readings and has 2 words"),
        ("FLASER 3 1 2 3 0 0 0 0 0\n", "line 2 is no FLASER line: it ends before its time"),
        ("FLASER 3 1 2 x 0 0 0 0 0 0 1 h 1\n", "line 2 is no FLASER line: it is cut off, or has a word"),
        ("FLASER 3 1 2 3 0 0 0 0 0 nan 1 h 1\n", "line 2 is no FLASER line: a pose or a time that is not"),
        ("FLASER 999999999 1\n", "999999999 readings"),
        ("FLASER -1 1\n", "-1 readings"),
        ("FLASER\n", "line 2 is no FLASER line: it is cut off"),
    ],
)
def test_a_damaged_line_is_named(tmp_path: Path, line: str, problem: str) -> None:
    path = written(tmp_path, FLASER.format(time=1.0) + line + FLASER.format(time=2.0))
    stream = carmen_scans(path)
    with pytest.raises(ScanFileError, match=problem) as caught:
        list(stream.scans)
    assert str(caught.value).startswith(f"{path}: ")


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", "is empty"),
        (b"hello\n", "no CARMEN log with scans"),
        (b"\x00\xff" * 1000, "no CARMEN log with scans"),
        (b"FLASER 0 0 0 0 0 0 0 1.0 h 1\n", "its first FLASER line has no readings"),
        (b"x" * (1 << 21), "line 1 is too long"),
        (gzip.compress(b"FLASER" * 9999, mtime=0)[:40], "cannot be unpacked after line 0"),
        (b"\x1f\x8b nonsense", "cannot be unpacked after line 0"),
        (ROBOTLASER.format(time=1.0).replace("2.0 1.0 20.0", "2.0 0.0 20.0").encode(), "0 rad from beam"),
    ],
)
def test_files_that_are_no_logs_are_refused_at_once(tmp_path: Path, content: bytes, problem: str) -> None:
    with pytest.raises(MapmeldError, match=problem) as caught:
        open_scans(written(tmp_path, content))
    assert "\n" not in str(caught.value)


def test_a_log_has_no_topics(tmp_path: Path) -> None:
    with pytest.raises(ScanFileError, match="has no topics"):
        open_scans(written(tmp_path, FLASER.format(time=1.0)), scan="/scan")


def test_a_file_that_is_missing_is_named(tmp_path: Path) -> None:
    with pytest.raises(MapmeldError, match="no such file"):
        open_scans(tmp_path / "none.log")


@given(st.binary(max_size=300), st.integers(0, 200))
def test_garbled_logs_raise_nothing_but_one_line(
    tmp_path_factory: pytest.TempPathFactory, junk: bytes, at: int
) -> None:
    log = (FLASER.format(time=1.0) + ROBOTLASER.format(time=2.0) + FLASER.format(time=3.0)).encode()
    path = written(tmp_path_factory.mktemp("logs"), log[:at] + junk + log[at + 20 :])
    problem = ""
    try:
        stamps = [scan.stamp for scan in open_scans(path).scans]
    except MapmeldError as error:
        problem, stamps = str(error), []
    assert "\n" not in problem
    assert all(map(math.isfinite, stamps))


@pytest.mark.parametrize("wrong", [0, 1, 3])
def test_one_wrong_time_does_not_cost_the_rest(tmp_path: Path, wrong: int) -> None:
    times = [1.0, 2.0, 3.0, 4.0, 5.0]
    text = "".join(FLASER.format(time=9e9 if n == wrong else time) for n, time in enumerate(times))
    stream = carmen_scans(written(tmp_path, text))
    assert [scan.stamp for scan in stream.scans] == times[:wrong] + times[wrong + 1 :]
    assert stream.left_out == {"a scan with a time stamp later than that of the next one": 1}
