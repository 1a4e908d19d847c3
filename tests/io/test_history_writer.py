"""Histories of maps as folders: whole or not at all, and nothing lost."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawing import drawn
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from mapmeld.grid import OccupancyGrid
from mapmeld.io import MapFileError, load
from mapmeld.io.folders import FolderError
from mapmeld.io.history_writer import write_history
from mapmeld.se2 import Pose2

PLAIN = replace(drawn("#. \n.##"), stamp=12.5, frame_id="r1/map")
PERCENT = OccupancyGrid(np.array([[0, 37, -1]]), 0.05, Pose2(1.0, -2.0, 0.3), 1700000000.123456, "r1/map")


def times_of(folder: Path) -> list[tuple[str, float]]:
    lines = [line for line in (folder / "times.txt").read_text().splitlines() if not line.startswith("#")]
    return [(line.split()[0], float(line.split()[1])) for line in lines]


def test_maps_and_times(tmp_path: Path) -> None:
    folder = tmp_path / "history"
    files = write_history(iter([PLAIN, PERCENT]), folder)
    assert files == (folder / "00000.yaml", folder / "00001.yaml")
    assert {file.name for file in folder.iterdir()} == {
        "00000.yaml", "00000.pgm", "00001.yaml", "00001.pgm", "times.txt",
    }  # fmt: skip
    assert times_of(folder) == [("00000.yaml", 12.5), ("00001.yaml", 1700000000.123456)]
    assert (folder / "times.txt").read_text().splitlines()[:2] == ["# map  stamp [s]", "# frame_id: r1/map"]
    for grid, file in zip([PLAIN, PERCENT], files, strict=True):
        assert load(file) == replace(grid, frame_id="")
    assert "mode: trinary" in files[0].read_text()
    assert "mode: raw" in files[1].read_text()


@given(
    cells=npst.arrays(
        np.int8, npst.array_shapes(min_dims=2, max_dims=2, max_side=5), elements=st.integers(-1, 100)
    ),
    stamp=st.floats(0, 1e10),
)
def test_nothing_is_lost(
    tmp_path_factory: pytest.TempPathFactory,
    cells: np.ndarray[tuple[int, int], np.dtype[np.int8]],
    stamp: float,
) -> None:
    folder = tmp_path_factory.mktemp("x") / "history"
    grid = OccupancyGrid(cells, 0.05, Pose2(0.1, 0.2, 0.3), stamp)
    (file,) = write_history([grid], folder)
    assert load(file) == grid
    assert times_of(folder) == [("00000.yaml", stamp)]


def test_a_frame_that_changes_is_noted_where_it_does(tmp_path: Path) -> None:
    write_history(
        [PLAIN, replace(PLAIN, frame_id="odd\nname"), replace(PLAIN, frame_id="odd\nname")], tmp_path / "h"
    )
    assert (tmp_path / "h" / "times.txt").read_text().splitlines()[3:] == [
        "# frame_id: odd\\nname",
        "00001.yaml 12.5",
        "00002.yaml 12.5",
    ]


def test_an_error_on_the_way_leaves_nothing(tmp_path: Path) -> None:
    def failing() -> Iterator[OccupancyGrid]:
        yield PLAIN
        raise MapFileError("the recording ends here")

    with pytest.raises(MapFileError, match="the recording ends here"):
        write_history(failing(), tmp_path / "history")
    assert list(tmp_path.iterdir()) == []


def test_no_states_no_folder(tmp_path: Path) -> None:
    with pytest.raises(MapFileError, match="there is no map to write"):
        write_history([], tmp_path / "history")
    with pytest.raises(MapFileError, match="state 1 has no stamp"):
        write_history([PLAIN, replace(PLAIN, stamp=None)], tmp_path / "history")
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_overwritten_unasked(tmp_path: Path) -> None:
    folder = tmp_path / "history"
    write_history([PLAIN] * 3, folder)
    (folder / "notes.md").write_text("mine")
    (folder / "2024.yaml").write_text("mine")
    with pytest.raises(FolderError, match="is not empty"):
        write_history([PERCENT], folder)
    assert len(times_of(folder)) == 3
    write_history([PERCENT], folder, force=True)
    assert {file.name for file in folder.iterdir()} == {
        "00000.yaml", "00000.pgm", "times.txt", "notes.md", "2024.yaml",
    }  # fmt: skip
    assert times_of(folder) == [("00000.yaml", PERCENT.stamp)]


def test_where_there_is_no_folder_to_write_into(tmp_path: Path) -> None:
    with pytest.raises(FolderError, match="does not exist"):
        write_history([PLAIN], tmp_path / "gone" / "history")
    (tmp_path / "file").write_text("mine")
    with pytest.raises(FolderError, match="is not a folder"):
        write_history([PLAIN], tmp_path / "file", force=True)
