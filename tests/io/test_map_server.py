import contextlib
import math
import os
import random
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
import yaml
from drawing import drawn
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from image_files import Pixels, bmp, pgm, png

from mapmeld.grid import OccupancyGrid
from mapmeld.io import MapFileError, Mode, images
from mapmeld.io.images import Raster, Samples, read_image
from mapmeld.io.map_server import cells_of, read_bare_image, read_description, read_map, write_map
from mapmeld.se2 import Pose2


# ---------------------------------------------------------------------- the readers of others, pixel by pixel
def c_round(x: float) -> int:
    return math.floor(x + 0.5) if x >= 0 else math.ceil(x - 0.5)


def nav2_cell(
    pixel: Sequence[int], maxval: int, mode: str, negate: bool, occupied: float, free: float
) -> int:
    """nav2 to Jazzy: every sample a 16-bit quantum; opacity is the last of 2 or 4 samples."""
    quanta = [65535 * sample // maxval for sample in pixel]
    has_alpha = len(pixel) in (2, 4)
    opacity = quanta.pop() if has_alpha else 65535
    if len(quanta) == 1:
        quanta *= 3
    if mode == "trinary" and has_alpha:
        quanta.append(opacity)
    total = 0.0
    for quantum in quanta:
        total += quantum
    shade = total / len(quanta) / 65535.0
    occupancy = shade if negate else 1.0 - shade
    if mode == "raw":
        value = c_round(shade * 255)
        return value if 0 <= value <= 100 else -1
    if mode == "scale" and opacity != 65535:
        return -1
    if occupied < occupancy:
        return 100
    if occupancy < free:
        return 0
    return -1 if mode == "trinary" else round((occupancy - free) / (occupied - free) * 100.0)


def newer_nav2_cell(pixel: Sequence[int], mode: str, negate: bool, occupied: float, free: float) -> int:
    """Newer nav2, of grey 8-bit pixels: single precision, and the thresholds themselves included."""
    has_alpha = len(pixel) in (2, 4)
    if mode == "raw":
        value = pixel[0] if pixel[0] < 128 else pixel[0] - 256
        return value if 0 <= value <= 100 else -1
    occupancy = np.float32(pixel[0]) / np.float32(255)
    if not negate:
        occupancy = np.float32(1) - occupancy
    if has_alpha and pixel[-1] < 255:
        return -1
    if float(occupancy) <= free:
        return 0
    if float(occupancy) >= occupied:
        return 100
    return -1 if mode == "trinary" else c_round((float(occupancy) - free) / (occupied - free) * 100)


def ros1_cell(pixel: Sequence[int], mode: str, negate: bool, occupied: float, free: float) -> int:
    """ROS 1, of 8-bit pixels: every channel counts in mode trinary, 99 percent are all."""
    has_alpha = len(pixel) in (2, 4)
    averaged = pixel if mode == "trinary" or not has_alpha else pixel[:-1]
    mean = sum(averaged) / len(averaged)
    if negate:
        mean = 255 - mean
    if mode == "raw":
        return int(mean) if mean < 128 else int(mean) - 256
    occupancy = (255 - mean) / 255.0
    if occupancy > occupied:
        return 100
    if occupancy < free:
        return 0
    if mode == "trinary" or (has_alpha and pixel[-1] < 1):
        return -1
    return int(99 * (occupancy - free) / (occupied - free))


# ---------------------------------------------------------------------- helpers
def description(**changes: object) -> str:
    """A sound YAML file, with fields changed, or left out where None."""
    fields = {
        "image": "map.pgm",
        "mode": "trinary",
        "resolution": "0.05",
        "origin": "[-1.5, 2, 0.25]",
        "negate": "0",
        "occupied_thresh": "0.65",
        "free_thresh": "0.196",
    }
    lines = [f"{key}: {value}" for key, value in {**fields, **changes}.items() if value is not None]
    return "\n".join(lines) + "\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "map.pgm").write_bytes(pgm(3, 2, 255, bytes([0, 205, 254, 254, 254, 0])))
    return tmp_path


def read(folder: Path, text: str | bytes) -> OccupancyGrid:
    path = folder / "map.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_map(path)


modes = st.sampled_from(get_args(Mode))
# Few lattice points of the unit interval, so that pixels lie exactly on thresholds.
thresholds = st.one_of(
    st.sampled_from([(0.65, 0.196), (0.65, 0.25), (1.0, 0.0), (0.9, 0.1), (0.5, 0.4)]),
    st.tuples(st.integers(0, 255), st.integers(0, 255))
    .filter(lambda pair: pair[0] != pair[1])
    .map(lambda pair: (max(pair) / 255, min(pair) / 255)),
)


# ---------------------------------------------------------------------- from grey to occupancy
@given(
    channels=st.integers(1, 4),
    maxval=st.sampled_from([255, 65535]),
    mode=modes,
    negate=st.booleans(),
    limits=thresholds,
    seed=st.integers(0, 2**32 - 1),
)
@example(channels=1, maxval=255, mode="trinary", negate=False, limits=(0.65, 0.25), seed=0)
def test_every_pixel_is_read_as_nav2_reads_it(
    channels: int, maxval: int, mode: Mode, negate: bool, limits: tuple[float, float], seed: int
) -> None:
    dice = random.Random(seed)
    special = [0, 1, 51, 100, 101, 128, 204, 205, 206, 254, 255]
    pool = [*(v * maxval // 255 for v in special), *(dice.randint(0, maxval) for _ in range(9))]
    pixels = [[[dice.choice(pool) for _ in range(channels)] for _ in range(7)] for _ in range(5)]
    samples: Samples = np.array(pixels, np.uint8) if maxval == 255 else np.array(pixels, np.uint16)
    cells = cells_of(
        Raster(samples, maxval), mode=mode, negate=negate, occupied_thresh=limits[0], free_thresh=limits[1]
    )
    expected = [[nav2_cell(pixel, maxval, mode, negate, *limits) for pixel in row] for row in pixels]
    assert cells[::-1].tolist() == expected


@pytest.mark.parametrize("mode", get_args(Mode))
@pytest.mark.parametrize("negate", [False, True])
def test_all_greys(mode: Mode, negate: bool) -> None:
    raster = Raster(np.arange(256, dtype=np.uint8).reshape(16, 16, 1), 255)
    cells = cells_of(raster, mode=mode, negate=negate, occupied_thresh=0.65, free_thresh=0.25)
    expected = [nav2_cell([grey], 255, mode, negate, 0.65, 0.25) for grey in range(256)]
    assert cells[::-1].reshape(-1).tolist() == expected
    assert len(set(expected)) == {"trinary": 3, "scale": 101, "raw": 102}[mode]


def test_large_images_are_taken_in_strips_without_a_seam(monkeypatch: pytest.MonkeyPatch) -> None:
    from mapmeld.io import map_server

    samples = np.random.default_rng(1).integers(0, 256, (13, 5, 4), dtype=np.uint8)
    whole = {mode: cells_of(Raster(samples, 255), mode=mode) for mode in get_args(Mode)}
    for pixels in (1, 5, 15, 20, 65):
        monkeypatch.setattr(map_server, "_PIXELS_AT_ONCE", pixels)
        for mode, cells in whole.items():
            assert np.array_equal(cells_of(Raster(samples, 255), mode=mode), cells)


def test_the_greatest_value_means_white(folder: Path) -> None:
    (folder / "map.pgm").write_bytes(pgm(3, 1, 1000, struct.pack(">3H", 0, 803, 1000)))
    assert read(folder, description()).cells.tolist() == [[100, -1, 0]]
    (folder / "map.pgm").write_bytes(pgm(3, 1, 100, bytes([34, 35, 81])))
    assert read(folder, description()).cells.tolist() == [[100, -1, 0]]


def test_raw_rounds_halves_up(folder: Path) -> None:
    (folder / "map.pgm").write_bytes(pgm(4, 1, 510, struct.pack(">4H", 0, 1, 199, 201)))
    assert read(folder, description(mode="raw")).cells.tolist() == [[0, 1, 100, -1]]


def test_the_top_row_of_the_image_is_the_last_of_the_grid(folder: Path) -> None:
    grid = read(folder, description())
    assert grid == drawn("# .\n..#", 0.05, Pose2(-1.5, 2.0, 0.25))
    assert not grid.cells.flags.writeable


def test_the_grey_for_unknown_turns_free_under_nav2_s_threshold_of_choice(folder: Path) -> None:
    # Not what anyone wants, but what nav2 does with such a file, see TRINARY_FREE_THRESH.
    assert read(folder, description(free_thresh="0.25")).cells.tolist() == [[0, 0, 100], [100, 0, 0]]


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("grey", png([[[0], [205], [254]]])),
        ("grey 16 bit", png([[[0], [205 * 257], [254 * 257]]], 16)),
        ("rgb", png([[[0] * 3, [205] * 3, [254] * 3]])),
        ("rgb 16 bit", png([[[0] * 3, [205 * 257] * 3, [254 * 257] * 3]], 16)),
        ("coloured", png([[[9, 0, 0], [205, 200, 210], [255, 255, 230]]])),
        ("bmp", bmp(3, 1, 24, bytes([0, 0, 0, 205, 205, 205, 254, 254, 254, 0, 0, 0]))),
    ],
)
@pytest.mark.parametrize("suffix", ["png", "bmp", "pgm"])
def test_any_image_under_any_name(folder: Path, name: str, data: bytes, suffix: str) -> None:
    (folder / f"image.{suffix}").write_bytes(data)
    assert read(folder, description(image=f"image.{suffix}")).cells.tolist() == [[100, -1, 0]]


@pytest.mark.parametrize("mode", get_args(Mode))
@pytest.mark.parametrize("depth", [8, 16])
def test_opacity_as_nav2_takes_it(folder: Path, mode: Mode, depth: int) -> None:
    maxval = (1 << depth) - 1
    greys: Pixels = [
        [[v * maxval // 255, a * maxval // 255] for v in (0, 90, 255)] for a in (255, 254, 90, 0)
    ]
    colours: Pixels = [[[v, v, v, a] for v, a in row] for row in greys]
    for pixels in (greys, colours):
        (folder / "map.png").write_bytes(png(pixels, depth))
        grid = read(folder, description(image="map.png", mode=mode))
        expected = [[nav2_cell(p, maxval, mode, False, 0.65, 0.196) for p in row] for row in pixels]
        assert grid.cells[::-1].tolist() == expected
        assert len({cell for row in expected for cell in row}) > 1


def test_one_transparent_grey_counts_as_opacity(folder: Path) -> None:
    raster = Raster(np.array([[[0, 0], [0, 255]]], np.uint8), 255)
    assert cells_of(raster, mode="scale").tolist() == [[-1, 100]]
    assert cells_of(raster).tolist() == [
        [nav2_cell(p, 255, "trinary", False, 0.65, 0.196) for p in ([0, 0], [0, 255])]
    ]


# ---------------------------------------------------------------------- round trips
numbers = st.floats(-1e9, 1e9, allow_nan=False)
origins = st.builds(Pose2, numbers, numbers, st.floats(-10, 10, allow_nan=False))
resolutions = st.floats(1e-3, 1e6, allow_nan=False)  # 1e9 m is as far as cells of 1 mm may lie
shapes = st.tuples(st.integers(1, 12), st.integers(1, 12))
percentages = arrays(np.int8, shapes, elements=st.integers(-1, 100))
classes = arrays(np.int8, shapes, elements=st.sampled_from([-1, 0, 100]))


@pytest.mark.parametrize("image_format", ["pgm", "png"])
@given(cells=classes, resolution=resolutions, origin=origins)
@example(cells=np.array([[-1]], np.int8), resolution=1e-07, origin=Pose2(1e-200, -0.0, 1e-300))
@example(cells=np.array([[-1]], np.int8), resolution=1e22, origin=Pose2(1e22, -1e22, 1e6))
@example(cells=np.array([[0, 100]], np.int8), resolution=0.1, origin=Pose2(0.1 + 0.2, 1e11, math.pi))
def test_trinary_keeps_classes_and_place_exactly(
    tmp_path_factory: pytest.TempPathFactory,
    image_format: str,
    cells: np.ndarray[tuple[int, int], np.dtype[np.int8]],
    resolution: float,
    origin: Pose2,
) -> None:
    path = tmp_path_factory.mktemp("map") / "map.yaml"
    grid = OccupancyGrid(cells, resolution, origin)
    write_map(grid, path, image_format=image_format)  # type: ignore[arg-type]
    assert read_map(path) == grid
    # The same numbers for readers of YAML 1.1.
    fields = yaml.safe_load(path.read_text())
    assert fields["resolution"] == resolution
    assert fields["origin"] == [origin.x, origin.y, origin.theta]


@pytest.mark.parametrize(("mode", "image_format"), [("raw", "pgm"), ("raw", "png"), ("scale", "png")])
@given(cells=percentages, resolution=resolutions, origin=origins)
@example(cells=np.arange(-1, 101, dtype=np.int8).reshape(2, 51), resolution=0.05, origin=Pose2())
def test_raw_and_scale_keep_every_percentage_exactly(
    tmp_path_factory: pytest.TempPathFactory,
    mode: Mode,
    image_format: str,
    cells: np.ndarray[tuple[int, int], np.dtype[np.int8]],
    resolution: float,
    origin: Pose2,
) -> None:
    path = tmp_path_factory.mktemp("map") / "map.yaml"
    grid = OccupancyGrid(cells, resolution, origin)
    write_map(grid, path, mode=mode, image_format=image_format)  # type: ignore[arg-type]
    assert read_map(path) == grid


@given(percentages, st.integers(0, 99).flatmap(lambda f: st.tuples(st.just(f), st.integers(f + 1, 100))))
def test_trinary_classifies_by_the_thresholds(
    tmp_path_factory: pytest.TempPathFactory,
    cells: np.ndarray[tuple[int, int], np.dtype[np.int8]],
    limits: tuple[int, int],
) -> None:
    free, occupied = limits
    path = tmp_path_factory.mktemp("map") / "map.yaml"
    write_map(OccupancyGrid(cells, 0.05), path, occupied_thresh=occupied / 100, free_thresh=free / 100)
    expected = np.full(cells.shape, -1)
    expected[cells >= occupied] = 100
    expected[(cells >= 0) & (cells <= free)] = 0
    assert np.array_equal(read_map(path).cells, expected)


@given(st.integers(0, 99).flatmap(lambda f: st.tuples(st.just(f), st.integers(f + 1, 100))))
@example((25, 65))
@example((0, 1))
def test_scale_stretches_between_other_thresholds(
    tmp_path_factory: pytest.TempPathFactory, limits: tuple[int, int]
) -> None:
    free, occupied = limits[0] / 100, limits[1] / 100
    path = tmp_path_factory.mktemp("map") / "map.yaml"
    percent = np.arange(101, dtype=np.int8)
    grid = OccupancyGrid(np.append(percent, np.int8(-1))[None], 0.05)
    write_map(grid, path, mode="scale", occupied_thresh=occupied, free_thresh=free)
    assert f"occupied_thresh: {occupied!r}\nfree_thresh: {free!r}\n" in path.read_text()
    back = read_map(path).cells[0].astype(float)
    assert back[-1] == -1
    stretched = np.clip((percent / 100 - free) / (occupied - free), 0, 1) * 100
    # Half a grey of 255 is 0.196 percent; then half a percent by rounding.
    assert np.abs(back[:-1] - stretched).max() <= 0.1961 / (occupied - free) + 0.5 + 1e-9


def as_others_see(path: Path) -> dict[str, list[list[int]]]:
    """Read a written map by the loops above; PyYAML's and OpenCV's own readers do the files."""
    fields = yaml.safe_load(path.read_text())
    raster = read_image(path.parent / fields["image"])
    limits = (fields["mode"], bool(fields["negate"]), fields["occupied_thresh"], fields["free_thresh"])
    rows = raster.samples[::-1].tolist()
    return {
        "nav2": [[nav2_cell(pixel, 255, *limits) for pixel in row] for row in rows],
        "newer nav2": [[newer_nav2_cell(pixel, *limits) for pixel in row] for row in rows],
        "ROS 1": [[ros1_cell(pixel, *limits) for pixel in row] for row in rows],
    }


@pytest.mark.parametrize("image_format", ["pgm", "png"])
def test_written_maps_mean_the_same_to_every_map_server(tmp_path: Path, image_format: str) -> None:
    grid = drawn("#. \n ..\n###")
    write_map(grid, tmp_path / "map.yaml", image_format=image_format)  # type: ignore[arg-type]
    for cells in as_others_see(tmp_path / "map.yaml").values():
        assert cells == grid.cells.tolist()


@pytest.mark.parametrize("mode", ["raw", "scale"])
def test_written_percentages_mean_the_same_to_every_map_server(tmp_path: Path, mode: Mode) -> None:
    grid = OccupancyGrid(np.arange(-1, 101, dtype=np.int8).reshape(2, 51), 0.05)
    write_map(grid, tmp_path / "map.yaml", mode=mode)
    seen = as_others_see(tmp_path / "map.yaml")
    assert seen["nav2"] == seen["newer nav2"] == grid.cells.tolist()
    # ROS 1 scales to 0..99 and cuts the rest off.
    below = grid.cells - np.array(seen["ROS 1"])
    assert below.min() >= 0
    assert below.max() <= (2 if mode == "scale" else 0)


# ---------------------------------------------------------------------- what is written
def test_the_files_in_full(tmp_path: Path) -> None:
    grid = drawn("# .\n..#", 0.05, Pose2(-10.0, 1e-7, 0.0))
    assert write_map(grid, tmp_path / "map.yaml") == (tmp_path / "map.yaml", tmp_path / "map.pgm")
    assert (tmp_path / "map.yaml").read_text() == (
        "image: map.pgm\n"
        "mode: trinary\n"
        "resolution: 0.05\n"
        "origin: [-10.0, 1.0e-07, 0.0]\n"
        "negate: 0\n"
        "occupied_thresh: 0.65\n"
        "free_thresh: 0.196\n"
    )
    assert (tmp_path / "map.pgm").read_bytes() == b"P5\n3 2\n255\n" + bytes([0, 205, 254, 254, 254, 0])


def test_the_written_thresholds_are_those_of_the_greys(tmp_path: Path) -> None:
    grid = drawn("# .")
    write_map(grid, tmp_path / "map.yaml", occupied_thresh=0.9, free_thresh=0.5)
    assert "occupied_thresh: 0.65\nfree_thresh: 0.196\n" in (tmp_path / "map.yaml").read_text()
    assert read_map(tmp_path / "map.yaml").cells.tolist() == grid.cells.tolist()


def test_scale_marks_unknown_by_transparency(tmp_path: Path) -> None:
    yaml_path, image_path = write_map(drawn("# ."), tmp_path / "map.yaml", mode="scale")
    assert image_path.suffix == ".png"
    assert "occupied_thresh: 1.0\nfree_thresh: 0.0\n" in yaml_path.read_text()
    assert read_image(image_path).samples[0].tolist() == [[0, 0, 0, 255], [128, 128, 128, 0], [255] * 4]


@pytest.mark.parametrize(
    "name", ["map.yaml", "0.yaml", "null.yaml", "with space.yaml", "a: b #c.yaml", '"quoted".yaml',
             "it's.yaml", "back\\slash.yaml", "-dash.yaml", "étage-二-😀.yaml", "[x].yaml", ".yaml.yaml"]
)  # fmt: skip
def test_any_legible_name_survives(tmp_path: Path, name: str) -> None:
    grid = drawn("#.")
    yaml_path, image_path = write_map(grid, tmp_path / name)
    assert read_map(yaml_path) == grid
    assert yaml.safe_load(yaml_path.read_text(encoding="utf-8"))["image"] == image_path.name


@pytest.mark.parametrize(
    ("name", "settings", "says"),
    [
        ("map.pgm", {}, "end it in .yaml"),
        ("map", {}, "end it in .yaml"),
        ("a\nb.yaml", {}, "characters that cannot be written"),
        ("a\udcff.yaml", {}, "characters that cannot be written"),
        ("map.yaml", {"mode": "grey"}, "there is no mode 'grey'; choose from trinary, scale, raw"),
        ("map.yaml", {"image_format": "bmp"}, "images are written as pgm or png, not as 'bmp'"),
        ("map.yaml", {"mode": "scale", "image_format": "pgm"}, "transparent, which PGM cannot; use png"),
        ("map.yaml", {"occupied_thresh": 0.2, "free_thresh": 0.3}, "is needed, not 0.3 and 0.2"),
        ("map.yaml", {"occupied_thresh": 0.3, "free_thresh": 0.3}, "is needed, not 0.3 and 0.3"),
        ("map.yaml", {"occupied_thresh": 1.1}, "is needed, not 0.25 and 1.1"),
        ("map.yaml", {"free_thresh": -0.1}, "is needed, not -0.1 and 0.65"),
        ("map.yaml", {"free_thresh": math.nan}, "is needed, not nan and 0.65"),
        ("nowhere/map.yaml", {}, "does not exist; make it first"),
    ],
)
def test_bad_settings_write_nothing(
    tmp_path: Path, name: str, settings: dict[str, object], says: str
) -> None:
    with pytest.raises(MapFileError) as caught:
        write_map(drawn("#."), tmp_path / name, **settings)  # type: ignore[arg-type]
    assert says in str(caught.value)
    assert str(caught.value).isprintable()
    assert list(tmp_path.iterdir()) == []


def test_a_map_without_cells_is_not_written(tmp_path: Path) -> None:
    with pytest.raises(MapFileError, match="the map has 0 cells"):
        write_map(OccupancyGrid(np.zeros((0, 3), np.int8), 0.05), tmp_path / "map.yaml")


@pytest.mark.parametrize("origin", [Pose2(1e15, 0, 0), Pose2(0, -1e300, 0), Pose2(0, 0, 2e6)])
def test_an_origin_that_could_not_be_read_again_is_not_written(tmp_path: Path, origin: Pose2) -> None:
    with pytest.raises(MapFileError, match="the map's origin"):
        write_map(drawn("#.", 0.05, origin), tmp_path / "map.yaml")
    assert list(tmp_path.iterdir()) == []


def test_coordinates_of_a_whole_country_are_near_enough(tmp_path: Path) -> None:
    grid = drawn("#.", 0.001, Pose2(9e6, -9e6, 1e6))
    write_map(grid, tmp_path / "map.yaml")
    assert read_map(tmp_path / "map.yaml") == grid


@pytest.mark.parametrize("existing", ["map.yaml", "map.pgm"])
def test_neither_file_is_overwritten_unasked(tmp_path: Path, existing: str) -> None:
    (tmp_path / existing).write_text("precious")
    with pytest.raises(MapFileError, match=f"{existing}: exists already"):
        write_map(drawn("#."), tmp_path / "map.yaml")
    assert [p.name for p in tmp_path.iterdir()] == [existing]
    assert (tmp_path / existing).read_text() == "precious"
    write_map(drawn("#."), tmp_path / "map.yaml", force=True)
    assert read_map(tmp_path / "map.yaml") == drawn("#.")


# ---------------------------------------------------------------------- the YAML file
def test_what_nav2_writes(folder: Path) -> None:
    text = (
        "image: map.pgm\nmode: trinary\nresolution: 0.05\norigin: [-12.2, 1e+03, -1.2e-16]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25"
    )
    (folder / "map.yaml").write_text(text)
    found = read_description(folder / "map.yaml")
    assert found.origin == Pose2(-12.2, 1000.0, -1.2e-16)
    assert (found.resolution, found.occupied_thresh, found.free_thresh) == (0.05, 0.65, 0.25)


def test_what_ros_1_writes(folder: Path) -> None:
    text = (
        "image: map.pgm\nresolution: 0.050000\norigin: [-100.000000, -51.224998, 0.000000]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n\n"
    )
    assert read(folder, text) == drawn("# .\n..#", 0.05, Pose2(-100.0, -51.224998, 0.0))


@pytest.mark.parametrize(
    "text",
    [
        description().replace("\n", "\r\n"),
        "\ufeff" + description(),
        "---\n" + description() + "...\n",
        "# a comment\n\n" + description(),
        description() + "---\nanother: [document\n",
        description(extra="{a: [1, {b: 2}], c: [[[]]]}"),
        description(more="\n  - [1, 2]\n  - a: b"),
        description(image="'map.pgm'"),
        description(image='"map.pgm"'),
        description(image="./map.pgm"),
        description(origin="\n- -1.5\n- 2\n- 0.25"),
        description(origin="[-1.5e0, 2., +.25]"),
        description(mode=None),
        description(mode="'trinary'"),
        description(negate=None),
        description(negate="false"),
        description(negate="No"),
        description(resolution="5e-2"),
        description(resolution="5.0E-02"),
        description(occupied_thresh=None),
        description(free_thresh=None),
        "{image: map.pgm, resolution: 0.05, origin: [-1.5, 2, 0.25]}",
    ],
)
def test_other_ways_to_say_the_same(folder: Path, text: str) -> None:
    assert read(folder, text) == drawn("# .\n..#", 0.05, Pose2(-1.5, 2.0, 0.25))


@pytest.mark.parametrize("negate", ["1", "true", "yes", "ON", "2"])
def test_negate(folder: Path, negate: str) -> None:
    # 205 is an occupancy of 0.8 then, so a wall; 254 more so.
    assert read(folder, description(negate=negate)).cells.tolist() == [[100, 100, 0], [0, 100, 100]]


def test_equal_thresholds_split_a_black_and_white_image(folder: Path) -> None:
    grid = read(folder, description(free_thresh="0.5", occupied_thresh="0.5"))
    assert grid.cells.tolist() == [[0, 0, 100], [100, 0, 0]]


def test_the_image_s_path(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "images").mkdir()
    (folder / "yamls").mkdir()
    (folder / "map.pgm").rename(folder / "images" / "a b.pgm")
    for image in ("../images/a b.pgm", folder / "images" / "a b.pgm"):
        assert read(folder / "yamls", description(image=image)).shape == (2, 3)
    monkeypatch.chdir(folder / "yamls")
    assert read_map("map.yaml").shape == (2, 3)
    monkeypatch.setenv("HOME", str(folder))
    with pytest.raises(MapFileError, match="no such file"):
        read(folder / "yamls", description(image="~/images/a b.pgm"))


LAUGHS = "a: &a [x, x]\nb: &b [*a, *a]\nc: [*b, *b]\n"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "is empty"),
        ("# nothing\n", "is not the YAML file of a map"),
        ("- 1\n- 2\n", "is not the YAML file of a map"),
        ("just words", "is not the YAML file of a map"),
        ("image: a: b", "is not valid YAML in line 1: mapping values are not allowed here"),
        ("image: [a", "is not valid YAML in line 1"),
        ("image: map.pgm\n\tmode: raw\n", "is not valid YAML in line 2"),
        ('image: "\\UFFFFFFFF"', "is not valid YAML"),
        ("%YAML 1." + "1" * 5000 + "\n---\na: b", "is not valid YAML"),
        ("a: !" + "x" * 5000 + "!y z", "is not valid YAML in line 1: "),
        ("image: \x00", "is not valid YAML: unacceptable character"),
        (b"\xff\xfei\x00m\x00", "is not UTF-8 text"),
        (pgm(2, 1, 255, b"\xff\xfe"), "is not UTF-8 text"),
        ("x" * 70_000, "is too large for the YAML file of a map (70,000 bytes"),
        ("[" * 60_000, "is not the YAML file of a map"),
        ("a: " + "[" * 60_000, "nests more than 20 levels deep in line 1"),
        ("a:\n" + "- " * 30_000, "nests more than 20 levels deep in line 2"),
        (LAUGHS + description(), "uses a YAML anchor or alias in line 1"),
        (description(extra="*x"), "uses a YAML anchor or alias in line 8"),
        (description(image="&x map.pgm"), "uses a YAML anchor or alias in line 1"),
        (description(image="!!python/object/apply:os.system ['true']"), "uses the YAML tag"),
        (description(extra="!!python/name:os.system"), "uses the YAML tag 'tag:yaml.org,2002:python/name:"),
        (description(resolution="!!float 0.05"), "uses the YAML tag"),
        ("!!python/object:a.b\nimage: map.pgm", "uses the YAML tag"),
        ("? [a, b]\n: c\n" + description(), "has a key that is no plain word, in line 1"),
        (description() + "resolution: 0.1\n", "gives 'resolution' twice, in line 8 again"),
        (description(image=None), "has no 'image'"),
        (description(image=""), "its 'image' is empty"),
        (description(image="[a.pgm]"), "its 'image' is not a text"),
        (description(image="none.pgm"), "none.pgm: no such file (the image of map.yaml)"),
        (description(image="."), "is a folder, not a file (the image of map.yaml)"),
        (description(image="/dev/zero"), "is not a plain file"),
        (description(image="map.yaml"), "is not a PGM, PNG or BMP image"),
        (description(image='"a\\0b"'), "not a usable file name"),
        (description(mode="Trinary"), "its 'mode' is 'Trinary', not one of trinary, scale, raw"),
        (description(mode="x" * 90), "its 'mode' is 'xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx...'"),
        (description(mode=""), "its 'mode' is ''"),
        (description(resolution=None), "has no 'resolution'"),
        (description(resolution=""), "its 'resolution' is '', which is not a number"),
        (description(resolution="0"), "its 'resolution' is 0.0, not a positive number of metres"),
        (description(resolution="-0.05"), "its 'resolution' is -0.05, not a positive"),
        (description(resolution=".nan"), "its 'resolution' is nan, not a positive"),
        (description(resolution=".inf"), "its 'resolution' is inf, not a positive"),
        (description(resolution="1e999"), "its 'resolution' is inf, not a positive"),
        (description(resolution="nan"), "its 'resolution' is 'nan', which is not a number"),
        (description(resolution="'0.05'"), "is the text '0.05'; write the number without quotes"),
        (description(resolution="0,05"), "its 'resolution' is '0,05', which is not a number"),
        (description(resolution="0.05 m"), "its 'resolution' is '0.05 m', which is not a number"),
        (description(resolution="1:30"), "its 'resolution' is '1:30', which is not a number"),
        (description(resolution="1_0"), "its 'resolution' is '1_0', which is not a number"),
        (description(resolution="."), "its 'resolution' is '.', which is not a number"),
        (description(resolution="true"), "its 'resolution' is 'true', which is not a number"),
        (description(resolution="[0.05]"), "its 'resolution' is not a number"),
        (description(resolution="{a: 1}"), "its 'resolution' is not a number"),
        (description(origin=None), "has no 'origin'"),
        (description(origin="[0, 0]"), "its 'origin' is not a list of three numbers [x, y, yaw]"),
        (description(origin="[0, 0, 0, 0]"), "its 'origin' is not a list of three"),
        (description(origin="0"), "its 'origin' is not a list of three"),
        (description(origin="{x: 0, y: 0, z: 0}"), "its 'origin' is not a list of three"),
        (description(origin="[0, [0], 0]"), "its 'origin' is not a number"),
        (description(origin="[0, a, 0]"), "its 'origin' is 'a', which is not a number"),
        (description(origin="[0, '1', 0]"), "its 'origin' is the text '1'"),
        (description(origin="[0, .nan, 0]"), "its 'origin' is [0.0, nan, 0.0], but must be finite"),
        (description(origin="[-.inf, 0, 0]"), "its 'origin' is [-inf, 0.0, 0.0], but must be finite"),
        (description(origin="[0, 0, 1e400]"), "but must be finite"),
        (description(origin="[1e300, 1e300, 0]"), "its origin [1e+300, 1e+300, 0.0] is too far from zero"),
        (description(origin="[0, -1e15, 0]"), "is too far from zero for cells of 0.05 m"),
        (description(origin="[1e7, 0, 0]", resolution="1e-9"), "is too far from zero for cells of 1e-09 m"),
        (description(origin="[0, 0, -1e7]"), "its origin has a yaw of -10000000.0 rad, beyond the 1,000,000"),
        (description(negate="maybe"), "its 'negate' is not 0 or 1"),
        (description(negate="'1'"), "its 'negate' is not 0 or 1"),
        (description(negate="0.5"), "its 'negate' is not 0 or 1"),
        (description(occupied_thresh="65"), "its 'occupied_thresh' is 65.0, not between 0 and 1"),
        (description(free_thresh="-0.1"), "its 'free_thresh' is -0.1, not between 0 and 1"),
        (description(free_thresh=".nan"), "its 'free_thresh' is nan, not between 0 and 1"),
        (description(free_thresh="0.7"), "are they the wrong way round?"),
        (description(mode="scale", free_thresh="0.65"), "are they the wrong way round?"),
    ],
)
def test_bad_yaml(folder: Path, text: str | bytes, says: str) -> None:
    with pytest.raises(MapFileError) as caught:
        read(folder, text)
    message = str(caught.value)
    assert says in message
    assert str(folder) in message or "/dev/zero" in message
    assert message.isprintable()  # and so on one line
    assert len(message) < 400


def test_tabs_are_named(folder: Path) -> None:
    with pytest.raises(MapFileError, match="YAML takes spaces, not tabs"):
        read(folder, "image: map.pgm\norigin:\n\t- 1\n")


def test_the_yaml_file_itself(tmp_path: Path) -> None:
    with pytest.raises(MapFileError, match=r"none\.yaml: no such file"):
        read_map(tmp_path / "none.yaml")
    with pytest.raises(MapFileError, match="is a folder"):
        read_map(tmp_path)
    os.mkfifo(tmp_path / "pipe.yaml")
    with pytest.raises(MapFileError, match="is not a plain file"):
        read_map(tmp_path / "pipe.yaml")


@given(st.binary(max_size=200))
@example(b"image: {")
@example(b"%YAML 9.9\n---\na: b")
@example(b"? ")
def test_no_bytes_bring_the_yaml_reader_down(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    path = tmp_path_factory.mktemp("map") / "map.yaml"
    path.write_bytes(data)
    with pytest.raises(MapFileError):
        read_map(path)


@given(st.integers(0, 400), st.binary(max_size=4))
def test_no_damage_brings_the_yaml_reader_down(
    tmp_path_factory: pytest.TempPathFactory, at: int, data: bytes
) -> None:
    folder = tmp_path_factory.mktemp("map")
    (folder / "map.pgm").write_bytes(pgm(3, 2, 255, bytes(6)))
    text = description().encode()
    (folder / "map.yaml").write_bytes(text[: at % len(text)] + data + text[at % len(text) + len(data) :])
    with contextlib.suppress(MapFileError):
        assert read_map(folder / "map.yaml").shape == (2, 3)


# ---------------------------------------------------------------------- maps with little in them
@pytest.mark.parametrize("picture", ["#", ".", " ", "   \n   ", "...\n..."])
def test_maps_with_nothing_to_match_on_are_maps(tmp_path: Path, picture: str) -> None:
    grid = drawn(picture)
    write_map(grid, tmp_path / "map.yaml")
    assert read_map(tmp_path / "map.yaml") == grid
    assert np.array_equal(read_bare_image(tmp_path / "map.pgm", 1.0).cells, grid.cells)


def test_the_limit_holds_for_writing_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from mapmeld.io import map_server

    write_map(drawn("##\n##"), tmp_path / "map.yaml")
    monkeypatch.setattr(images, "MAX_CELLS", 3)
    monkeypatch.setattr(map_server, "MAX_CELLS", 3)
    with pytest.raises(MapFileError, match="declares 2 x 2 pixels, more than the 3 that are read"):
        read_map(tmp_path / "map.yaml")
    with pytest.raises(MapFileError, match="the map has 4 cells; from 1 to 3 can be written"):
        write_map(drawn("##\n##"), tmp_path / "other.yaml")
