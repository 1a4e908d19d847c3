from dataclasses import replace
from pathlib import Path

import pytest
from drawing import drawn
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.io import MapFileError, save
from mapmeld.io.history import read_history
from mapmeld.io.history_writer import write_history

MAP = drawn("#.\n.#", 0.5)


def maps(folder: Path, *names: str) -> Path:
    """Maps of one row, each with as many floor cells as its place in the list."""
    folder.mkdir(exist_ok=True)
    for k, name in enumerate(names, start=1):
        save(drawn("#" + "." * k), folder / name)
    return folder


def cells_of(folder: Path) -> list[int]:
    return [grid.shape[1] - 1 for grid in read_history(folder)]


def test_the_names_are_the_times(tmp_path: Path) -> None:
    folder = maps(tmp_path / "h", "00080.yaml", "7.yaml", "12.345.yaml")
    history = read_history(folder)
    assert history.stamps == (7.0, 12.345, 80.0)
    assert cells_of(folder) == [2, 3, 1]
    assert [grid.stamp for grid in history] == [7.0, 12.345, 80.0]
    assert len(history) == 3
    assert history[-1].stamp == 80.0
    assert [grid.stamp for grid in history[1:]] == [12.345, 80.0]
    assert list(history) == list(history), "it can be gone through again"


def test_a_list_of_times(tmp_path: Path) -> None:
    folder = maps(tmp_path / "h", "b.yaml", "a map.yaml", "000.yaml", "extra.yaml")
    (folder / "times.txt").write_text(
        "# all of them\n\na map.yaml  3.5 # the second\nb 1e3\r\n 0 -2\n", encoding="utf-8"
    )
    history = read_history(folder)
    assert history.stamps == (-2.0, 3.5, 1000.0)
    assert cells_of(folder) == [3, 2, 1], "what the list does not name is no state"


@pytest.mark.parametrize("seconds", ["1e308", "-1e308", "9000000001", "-9.1e9", "1e999", "nan"])
def test_times_that_no_clock_shows(tmp_path: Path, seconds: str) -> None:
    folder = maps(tmp_path / "h", "a.yaml", "b.yaml")
    (folder / "times.txt").write_text(f"a 9e9\nb {seconds}\n")
    with pytest.raises(
        MapFileError, match=r"line 2: 'NAME\.yaml SECONDS' is needed, .* no time is beyond 9,000,000,000"
    ):
        read_history(folder)
    (folder / "times.txt").write_text("a 9e9\nb -9e9\n")
    assert read_history(folder).stamps == (-9e9, 9e9)


@pytest.mark.parametrize("name", ["9000000001", "9" * 200])
def test_names_that_are_no_times_any_more(tmp_path: Path, name: str) -> None:
    with pytest.raises(MapFileError, match="its name is no time"):
        read_history(maps(tmp_path / "h", "1.yaml", f"{name}.yaml"))


def test_states_of_one_moment_stay_in_order(tmp_path: Path) -> None:
    folder = maps(tmp_path / "h", "a.yaml", "b.yaml", "c.yaml")
    (folder / "times.txt").write_text("b.yaml 5\nc.yaml 5\na.yaml 5\n")
    assert cells_of(folder) == [2, 3, 1]


def test_a_state_is_read_when_it_is_reached(tmp_path: Path) -> None:
    folder = maps(tmp_path / "h", "1.yaml", "2.yaml")
    (folder / "2.pgm").unlink()
    states = iter(read_history(folder))
    assert next(states).stamp == 1.0
    with pytest.raises(MapFileError, match=r"2\.pgm"):
        next(states)


def test_other_files_do_not_disturb(tmp_path: Path) -> None:
    folder = maps(tmp_path / "h", "1.yaml", "2.YML")
    (folder / "notes.md").write_text("later")
    (folder / ".3.yaml").write_text("hidden")
    (folder / "4").mkdir()
    assert read_history(folder).stamps == (1.0, 2.0)


@given(st.lists(st.floats(0, 4e9, allow_nan=False), min_size=1, max_size=5))
def test_what_is_written_is_read(stamps: list[float]) -> None:
    import tempfile

    stamps = sorted(stamps)
    with tempfile.TemporaryDirectory() as folder:
        states = [replace(MAP, stamp=stamp) for stamp in stamps]
        write_history(states, Path(folder, "h"))
        found = list(read_history(Path(folder, "h")))
    assert found == states
    assert [grid.stamp for grid in found] == stamps


@pytest.mark.parametrize(
    ("times", "problem"),
    [
        ("1.yaml", "line 1: 'NAME.yaml SECONDS' is needed"),
        ("\n1.yaml later", "line 2: 'NAME.yaml SECONDS' is needed, not '1.yaml later'"),
        ("1.yaml nan", "line 1"),
        ("1.yaml inf", "line 1"),
        ("5.yaml 3", "there is no map '5.yaml' in the folder"),
        ("../h/1.yaml 3", "there is no map"),
        ("1.yaml 3\n1.yaml 4", "line 2: 1.yaml has a time already"),
        ("1 3\n1.yaml 4", "has a time already"),
        ("# nothing\n", "names no states"),
        ("9" * 30 + " 1", "there is no map"),
    ],
)
def test_lists_of_times_that_cannot_be_right(tmp_path: Path, times: str, problem: str) -> None:
    folder = maps(tmp_path / "h", "1.yaml", "2.yaml")
    (folder / "times.txt").write_text(times)
    with pytest.raises(MapFileError) as caught:
        read_history(folder)
    assert problem in str(caught.value)
    assert "times.txt" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_lists_that_are_no_text(tmp_path: Path) -> None:
    folder = maps(tmp_path / "h", "1.yaml")
    (folder / "times.txt").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(MapFileError, match="not a text file"):
        read_history(folder)
    (folder / "times.txt").write_bytes(b"#" * 10_000_001)
    with pytest.raises(MapFileError, match="no list of times"):
        read_history(folder)
    (folder / "times.txt").unlink()
    (folder / "times.txt").mkdir()
    with pytest.raises(MapFileError, match=r"times\.txt: cannot be read"):
        read_history(folder)


def test_folders_that_are_no_history(tmp_path: Path) -> None:
    with pytest.raises(MapFileError, match="there is no such folder"):
        read_history(tmp_path / "nowhere")
    with pytest.raises(MapFileError, match="holds no map_server YAML files"):
        read_history(tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(MapFileError, match="is not a folder"):
        read_history(tmp_path / "file")
    maps(tmp_path / "h", "1.yaml", "final.yaml")
    with pytest.raises(MapFileError, match=r"final\.yaml: its name is no time"):
        read_history(tmp_path / "h")


def test_a_damaged_state(tmp_path: Path) -> None:
    folder = maps(tmp_path / "h", "1.yaml")
    (folder / "1.yaml").write_text("image: [")
    with pytest.raises(MapFileError, match=r"1\.yaml"):
        read_history(folder)[0]
