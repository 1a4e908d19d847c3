"""The face of mapmeld.io: `load`, `save` and the error they raise."""

import math
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from image_files import pgm

import mapmeld
from mapmeld import io
from mapmeld.grid import OccupancyGrid
from mapmeld.io import FORMATS, MapFileError, load, printable, save
from mapmeld.se2 import Pose2

GRID = OccupancyGrid(np.array([[-1, 0, 100], [0, 0, 100]], np.int8), 0.05, Pose2(1.0, -2.0, 0.3))


def test_the_package_gives_the_same_functions() -> None:
    assert (mapmeld.load, mapmeld.save) == (io.load, io.save)
    assert issubclass(MapFileError, mapmeld.MapmeldError)


def test_importing_is_light() -> None:
    code = "import sys, mapmeld.io; print([m for m in ('cv2', 'yaml', 'numpy') if m in sys.modules])"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]"


def test_a_pgm_map_needs_no_opencv(tmp_path: Path) -> None:
    save(GRID, tmp_path / "map.yaml")
    code = (
        "import sys; sys.modules['cv2'] = None; from mapmeld.io import load, save;"
        "save(load(sys.argv[1]), sys.argv[2])"
    )
    subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "map.yaml"), str(tmp_path / "b.yaml")], check=True
    )
    assert load(tmp_path / "b.yaml") == GRID


@pytest.mark.parametrize("name", ["map.yaml", "map.yml", "MAP.YAML", "a.b.yaml", "with space.yaml"])
def test_a_map_and_back(tmp_path: Path, name: str) -> None:
    written = save(GRID, str(tmp_path / name))
    assert written == (tmp_path / name, (tmp_path / name).with_suffix(".pgm"))
    assert sorted(tmp_path.iterdir()) == sorted(written)
    assert load(tmp_path / name) == load(str(tmp_path / name)) == GRID


def test_a_bare_image_needs_a_resolution(tmp_path: Path) -> None:
    (tmp_path / "map.pgm").write_bytes(pgm(3, 2, 255, bytes([205, 254, 0, 254, 254, 0])))
    (tmp_path / "map.yaml").write_text("resolution: 1")  # its being there changes nothing
    with pytest.raises(MapFileError, match=r"map\.pgm: .* give its YAML file, or the resolution \[m\]"):
        load(tmp_path / "map.pgm")
    grid = load(tmp_path / "map.pgm", resolution=0.1)
    assert grid == OccupancyGrid(np.array([[0, 0, 100], [-1, 0, 100]], np.int8), 0.1)


@pytest.mark.parametrize("resolution", [0.0, -0.05, math.nan, math.inf])
def test_a_bare_image_needs_a_sensible_resolution(tmp_path: Path, resolution: float) -> None:
    (tmp_path / "map.pgm").write_bytes(pgm(1, 1, 255, b"a"))
    with pytest.raises(MapFileError, match=r"map\.pgm: the resolution must be a positive number of metres"):
        load(tmp_path / "map.pgm", resolution=resolution)


def test_a_map_that_states_its_resolution_takes_no_other(tmp_path: Path) -> None:
    save(GRID, tmp_path / "map.yaml")
    with pytest.raises(MapFileError, match="states its own resolution"):
        load(tmp_path / "map.yaml", resolution=0.05)


def test_the_format_can_be_named(tmp_path: Path) -> None:
    save(GRID, tmp_path / "map.yaml")
    (tmp_path / "description").write_bytes((tmp_path / "map.yaml").read_bytes())
    (tmp_path / "picture.jpg").write_bytes((tmp_path / "map.pgm").read_bytes())
    assert load(tmp_path / "description", format="map_server") == GRID
    picture = load(tmp_path / "picture.jpg", format="image", resolution=0.05)
    assert np.array_equal(picture.cells, GRID.cells)
    with pytest.raises(MapFileError, match=r"not a known kind of map file .*yaml .*pgm"):
        load(tmp_path / "description")
    with pytest.raises(
        MapFileError, match=r"no map format is called 'bag' \(there are: map_server, image, recording\)"
    ):
        load(tmp_path / "description", format="bag")


def test_readers_get_the_path_as_it_was_given(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[tuple[str, float | None]] = []

    def read(path: str, resolution: float | None) -> OccupancyGrid:
        seen.append((path, resolution))
        return GRID

    monkeypatch.setitem(FORMATS, "recording", io.MapFormat((".bag",), read))
    assert load("some//file.bag#/map@12.5") is GRID
    assert load("any#thing@all", format="recording") is GRID
    assert load("file.BAG") is GRID
    assert seen == [("some//file.bag#/map@12.5", None), ("any#thing@all", None), ("file.BAG", None)]


def test_messages_stay_on_one_line_whatever_the_name(tmp_path: Path) -> None:
    with pytest.raises(MapFileError) as caught:
        load(tmp_path / "line\nbreak \x1b[31mred.yaml")
    assert str(caught.value).isprintable()
    assert "line\\nbreak" in str(caught.value)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_names_in_other_letters_stay_legible() -> None:
    assert str(MapFileError.of("étage-二.yaml", "no")) == "étage-二.yaml: no"


def test_a_folder_is_called_a_folder(tmp_path: Path) -> None:
    with pytest.raises(MapFileError, match=f"^{tmp_path}: is a folder"):
        load(tmp_path)


def test_what_does_not_print_is_escaped() -> None:
    assert printable("a\nb\x1b[31m\udce9 é") == "a\\nb\\x1b[31m\\udce9 é"
