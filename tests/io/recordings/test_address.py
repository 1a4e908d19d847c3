"""``FILE#topic@time``: what is a file's name and what is not; which state is meant."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from bag_files import START, sent_map, sent_text, story, write_mcap, write_rosbag1, write_rosbag2
from hypothesis import given
from hypothesis import strategies as st
from rosbags.rosbag2 import StoragePlugin

import mapmeld
from mapmeld.io import MapFileError, format_of, save
from mapmeld.io.recordings.address import Address, parse_address, split_address


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return write_mcap(tmp_path, story())


# ---------------------------------------------------------------- the form
@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("run.mcap", ("run.mcap", None, None)),
        ("run.mcap#", ("run.mcap", None, None)),
        ("run.mcap#/map", ("run.mcap", "/map", None)),
        ("RUN.BAG#map", ("RUN.BAG", "map", None)),
        ("run.bag#/map@12.5", ("run.bag", "/map", 12.5)),
        ("run.db3#@.5", ("run.db3", None, 0.5)),
        ("a#b/run.mcap#/map@0", ("a#b/run.mcap", "/map", 0.0)),
        ("run.bag#/map@1700000000.25", ("run.bag", "/map", 1700000000.25)),
        ("plan#2.yaml", ("plan#2.yaml", None, None)),
        ("#", ("#", None, None)),
        ("#/map", ("#/map", None, None)),
    ],
)
def test_parts(text: str, expected: tuple[str, str | None, float | None]) -> None:
    assert parse_address(text) == Address(*expected)


@pytest.mark.parametrize(
    "time", ["", "x", "-1", "+3", "1e5", "nan", "inf", "1.2.3", "1@2", "٣", " 1", "9" * 19]
)
def test_times_that_are_none(time: str) -> None:
    with pytest.raises(MapFileError, match=r"the time after '@' must be a number of seconds"):
        parse_address(f"run.mcap#/map@{time}")


@given(st.text(max_size=20))
def test_any_text_has_a_file_and_what_follows(text: str) -> None:
    if "\0" not in text:
        file, rest = split_address(text)
        assert text == (file if rest is None else f"{file}#{rest}")


def test_what_exists_under_the_whole_name_is_that_file(file: Path, tmp_path: Path) -> None:
    shutil.copy(file, tmp_path / "run.mcap#.mcap")
    odd = tmp_path / "a#map.mcap"
    shutil.copy(file, odd)
    assert parse_address(str(odd)) == Address(str(odd), None, None)
    assert parse_address(f"{odd}#/robot_1/map") == Address(str(odd), "/robot_1/map", None)
    assert mapmeld.load(f"{odd}#/robot_2/map").shape == (1, 2)
    grid = mapmeld.load(f"{odd}#/robot_2/map")
    save(grid, tmp_path / "plan#2.yaml")
    assert (mapmeld.load(tmp_path / "plan#2.yaml").cells == grid.cells).all()


def test_kinds_of_files(file: Path, tmp_path: Path) -> None:
    folder = write_rosbag2(tmp_path, story(), StoragePlugin.SQLITE3)
    for text in (
        file,
        f"{file}#/map",
        folder,
        f"{folder}#/map@1",
        f"{folder}/run.db3",
        "gone.bag",
        "gone.bag#/map",
    ):
        assert format_of(text) == "recording", text
    assert format_of("a.yaml") == format_of("a#1.yaml") == "map_server"
    assert format_of("a.PNG") == "image"
    assert format_of(tmp_path) is None


# ---------------------------------------------------------------- the state that is meant
def test_without_a_time_the_last_state(file: Path) -> None:
    grid = mapmeld.load(f"{file}#/robot_1/map")
    assert (grid.stamp, grid.frame_id, int(grid.cells[1, 0])) == (START + 5.99, "r1", 1)


@pytest.mark.parametrize(
    ("time", "stamp"),
    [
        ("1", 0.98),  # received at this very moment
        ("2.999", 0.98),
        ("3", 2.99),
        ("5.99", 3.98),  # stamped by then, but received later
        ("6", 5.99),
        ("1000", 5.99),
        (f"{START}.98", 0.98),  # from 1e8 on, stamps count
        (f"{START + 3}.97", 2.99),
        (f"{START + 3}.98", 3.98),
        (f"{START + 1000}", 5.99),
    ],
)
def test_the_state_that_was_current(file: Path, time: str, stamp: float) -> None:
    assert mapmeld.load(f"{file}#/robot_1/map@{time}").stamp == START + stamp


@pytest.mark.parametrize("time", ["0", "0.999", str(START)])
def test_before_the_first_state(file: Path, time: str) -> None:
    line = rf"{re.escape(str(file))}#/robot_1/map@{time}: there was no map yet; the first came 1\.000 s after the start, with the stamp {START}\.98$"  # noqa: E501
    with pytest.raises(MapFileError, match=line):
        mapmeld.load(f"{file}#/robot_1/map@{time}")


def test_the_only_topic_needs_no_name(tmp_path: Path) -> None:
    file = write_rosbag1(tmp_path, [sent_text(0, "x"), sent_map(1, [[0]]), sent_map(2, [[100]])])
    assert mapmeld.load(file).cells.tolist() == [[100]]
    assert mapmeld.load(f"{file}#").cells.tolist() == [[100]]
    assert mapmeld.load(f"{file}#@1.5").cells.tolist() == [[0]]


def test_folders_are_recordings_too(tmp_path: Path) -> None:
    folder = write_rosbag2(tmp_path, story(), StoragePlugin.MCAP)
    assert mapmeld.load(f"{folder}#/robot_2/map").shape == (1, 2)
    with pytest.raises(MapFileError, match="has maps on 2 topics"):
        mapmeld.load(folder)


def test_the_kind_can_be_named(file: Path, tmp_path: Path) -> None:
    file.rename(tmp_path / "odd.name")
    assert mapmeld.load(f"{tmp_path / 'odd.name'}#/robot_2/map", format="recording").shape == (1, 2)


def test_a_topic_without_maps_with_cells(tmp_path: Path) -> None:
    import numpy as np

    file = write_mcap(tmp_path, [sent_map(0, np.zeros((0, 0)))])
    with pytest.raises(MapFileError, match=r"run.mcap: /map has no map with cells$"):
        mapmeld.load(file)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("gone.mcap", "gone.mcap: no such file"),
        ("gone.bag#/map", "gone.bag: no such file"),
        ("plan.yaml#/map", r"plan.yaml: is no recording"),
        ("folder", "folder: is a folder; name the map file in it"),
        ("folder#/map", "folder: is a folder without metadata.yaml, so not a whole rosbag2 recording$"),
        ("empty.bag", "empty.bag: is empty"),
        ("text.bag", "text.bag: is no recording"),
        ("old.bag", "old.bag: is of an old version of rosbag1"),
        ("other.sqlite#/map", "other.sqlite: is an SQLite database, but"),
        ("folder.mcap", "folder.mcap: is a folder without metadata.yaml"),
    ],
)
def test_what_is_no_recording(tmp_path: Path, text: str, problem: str) -> None:
    contents = {
        "plan.yaml": b"image: x\n",
        "empty.bag": b"",
        "text.bag": b"hello",
        "old.bag": b"#ROSBAG V1.2\n",
        "other.sqlite": b"SQLite format 3\0 and more",
    }
    for name, content in contents.items():
        (tmp_path / name).write_bytes(content)
    for name in ("folder", "folder.mcap"):
        (tmp_path / name).mkdir()
    with pytest.raises(MapFileError, match=problem):
        mapmeld.load(f"{tmp_path}/{text}")


def test_a_recording_states_its_own_resolution(file: Path) -> None:
    with pytest.raises(MapFileError, match="states its own resolution"):
        mapmeld.load(f"{file}#/robot_1/map", resolution=0.05)


def test_without_the_extra_one_line_says_how_to_get_it(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    from mapmeld.extras import MissingExtraError
    from mapmeld.io.recordings import map_states

    for name in [name for name in sys.modules if name.split(".")[0] in ("mcap", "rosbags")]:
        monkeypatch.delitem(sys.modules, name)
    for name in ("mcap", "rosbags"):
        monkeypatch.setitem(sys.modules, name, None)
    bag = file.with_name("run.bag")
    bag.write_bytes(b"#ROSBAG V2.0\n")
    for path in (file, bag):
        with pytest.raises(MissingExtraError, match=r'pip install "mapmeld\[bags\]"'):
            map_states(path)
