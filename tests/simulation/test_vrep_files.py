from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.io import MapFileError
from mapmeld.simulation import (
    Configuration,
    Settings,
    SimulationError,
    generate,
    read_configuration,
    read_map_text,
    write_configuration,
    write_map_text,
)
from mapmeld.simulation.vrep_files import configuration_text, map_text

EMPTY_GROUND = "8:1:1:1:7\n0:-2:-2:-2:0\n0:-2:-2:-2:0\n9:1:1:1:6\n"


def written(path: Path, text: str | bytes) -> Path:
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


# ---------------------------------------------------------------------- map text
def test_an_empty_ground_of_5_x_4(tmp_path: Path) -> None:
    ground = generate(Settings(5, 5, Configuration(0, ()), furniture=0.0)).fields
    assert map_text(np.delete(ground, 1, axis=0)) == EMPTY_GROUND
    fields = read_map_text(written(tmp_path / "map.txt", EMPTY_GROUND))
    assert fields.shape == (4, 5)
    assert fields[0, 0] == 9  # the last line is the bottom row
    assert fields[-1, 0] == 8


@given(st.integers(0, 500))
def test_maps_come_back(seed: int) -> None:
    fields = generate(Settings(16, 13, Configuration(4), furniture=0.0), seed).fields
    text = map_text(fields)
    assert text.endswith("\n")
    assert not any(line.endswith(":") for line in text.splitlines())
    rows = [list(map(int, line.split(":"))) for line in text.splitlines()]
    assert np.array_equal(np.array(rows)[::-1], fields)


def test_a_file_comes_back(tmp_path: Path) -> None:
    fields = generate(Settings(furniture=0.0), 4).fields
    write_map_text(fields, tmp_path / "map.txt")
    assert np.array_equal(read_map_text(tmp_path / "map.txt"), fields)
    with pytest.raises(MapFileError, match="exists already"):
        write_map_text(fields, tmp_path / "map.txt")


@pytest.mark.parametrize(
    "text", [EMPTY_GROUND.replace("\n", "\r\n"), EMPTY_GROUND + "\n\n", EMPTY_GROUND.rstrip()]
)
def test_line_ends_of_other_systems(tmp_path: Path, text: str) -> None:
    assert map_text(read_map_text(written(tmp_path / "map.txt", text))) == EMPTY_GROUND


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "is empty"),
        (" \n \n", "line 1 is blank"),
        ("8:1:7\n0:-2:0\n\n9:1:6\n", "line 3 is blank"),
        ("8:1:7\n0:-2\n9:1:6\n", "line 2 has 2 fields, line 1 has 3"),
        ("8:1:7\n0:x:0\n9:1:6\n", "line 2, field 2: 'x' is no code"),
        ("8:1:7\n0:11:0\n9:1:6\n", "'11' is no code"),
        ("8:1:7\n0:-3:0\n9:1:6\n", "from -2 to 10"),
        ("8:1:7\n0::0\n9:1:6\n", "field 2: '' is no code"),
        ("8:1:7:\n0:-2:0:\n9:1:6:\n", "line 1, field 4"),
        ("8:1:7\n0:99999999999999999999:0\n9:1:6\n", "no code"),
        ("8:1:7\n0:1.0:0\n9:1:6\n", "no code"),
        ("8:1:1:1:7\n0:-2:-2:-2:0\n0:-2:-1:-2:0\n0:-2:-2:-2:0\n9:1:1:1:6", "line 3, field 3: a door"),
        ("8:7\n9:6\n", "2 x 2 fields"),
        (":".join("1" * 201) + "\n" + ":".join("1" * 201), "201 x 2 fields"),
        (b"8:1:7\n0:\xb2:0\n9:1:6\n", "ASCII"),
        (b"\x00" * 400, "no code"),
        ("1:" * 200_000, "too large"),
    ],
)
def test_hostile_maps(tmp_path: Path, text: str | bytes, said: str) -> None:
    with pytest.raises(MapFileError, match=said) as caught:
        read_map_text(written(tmp_path / "map.txt", text))
    assert "\n" not in str(caught.value)
    assert "map.txt" in str(caught.value)


def test_no_such_map(tmp_path: Path) -> None:
    with pytest.raises(MapFileError, match="no such file"):
        read_map_text(tmp_path / "nowhere.txt")


# ---------------------------------------------------------------------- configuration
@given(
    st.builds(
        Configuration,
        st.integers(0, 500),
        st.lists(st.tuples(st.integers(2, 20), st.integers(2, 20)), min_size=1).map(tuple),
    )
)
def test_configurations_come_back(configuration: Configuration) -> None:
    lines = configuration_text(configuration).splitlines()
    assert lines[0] == str(configuration.rooms)
    assert lines[1:] == [f"{width}:{height}" for width, height in configuration.room_types]


def test_a_configuration_file(tmp_path: Path) -> None:
    path = written(tmp_path / "config.txt", "10\n4:4\n5:6\n 20:2 \n")
    assert read_configuration(path) == Configuration(10, ((4, 4), (5, 6), (20, 2)))
    write_configuration(read_configuration(path), tmp_path / "again.txt")
    assert read_configuration(tmp_path / "again.txt") == read_configuration(path)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "is empty"),
        ("ten\n4:4\n", "line 1: the number of rooms"),
        ("4:4\n4:4\n", "line 1"),
        ("10\n4\n", "line 2: a room type is width:height, not '4'"),
        ("10\n4:4:4\n", "line 2"),
        ("10\n4:x\n", "line 2"),
        ("10\n4:4\n1:4\n", "line 3: sides of rooms are integers from 2 to 20"),
        ("10\n4:21\n", "2 to 20"),
        ("-1\n4:4\n", "0 to 500 rooms"),
        ("501\n4:4\n", "0 to 500 rooms"),
        ("3\n", "at least one room type"),
        ("3\n\n4:4\n", "line 2 is blank"),
        ("3\n4:4.5\n", "line 2"),
    ],
)
def test_hostile_configurations(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(MapFileError, match=said) as caught:
        read_configuration(written(tmp_path / "config.txt", text))
    assert "\n" not in str(caught.value)


def test_a_room_type_out_of_range() -> None:
    with pytest.raises(SimulationError, match="room type 1:4"):
        Configuration(1, ((1, 4),))
