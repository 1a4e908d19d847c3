"""ROS ``map_server`` and nav2 maps: a YAML file that names an image, read and written by their rules.

The rules are those of nav2_map_server's ``map_io.cpp`` up to the Jazzy release, which are also
those of ROS 1 for the maps that are met in practice. Later nav2 releases read images with colours
or partial transparency, and occupancies that lie exactly on a threshold, a little differently;
the maps written here read the same in all of them.
"""

from __future__ import annotations

import json
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn, get_args

import numpy as np
from numpy.typing import NDArray

from mapmeld.grid import FREE, OCCUPIED, UNKNOWN, Cells, OccupancyGrid
from mapmeld.io import AnyPath, ImageFormat, MapFileError, Mode
from mapmeld.io.atomic import check_targets, write_files
from mapmeld.io.images import MAX_CELLS, Raster, pgm_pieces, png_pieces, read_image
from mapmeld.io.plain_yaml import Scalar, Value, read_fields, short
from mapmeld.se2 import Pose2

MAX_ORIGIN_YAW = 1e6
"""Greatest yaw of an origin [rad]; a sign of another unit or a broken file, and inexact beyond."""

# The greys of mode "trinary".
FREE_GREY, UNKNOWN_GREY, OCCUPIED_GREY = 254, 205, 0

# The thresholds in files of mode "trinary", whatever thresholds chose the greys. A reader takes
# grey 205 for an occupancy of (255 - 205) / 255 = 0.19608, so the free_thresh of 0.25 with which nav2
# chooses the greys, and which it used to write too, turns all unknown space to free when the map
# is read. ROS 1 writes 0.196 for that reason, and so does nav2 since its pull request 5278.
TRINARY_OCCUPIED_THRESH, TRINARY_FREE_THRESH = 0.65, 0.196

# What chooses the greys, by default: the defaults of nav2's map_saver.
OCCUPIED_THRESH, FREE_THRESH = 0.65, 0.25
OLD_FREE_THRESH = FREE_THRESH  # in the files that nav2 wrote before

_PIXELS_AT_ONCE = 1 << 20


@dataclass(frozen=True, slots=True)
class MapDescription:
    """What the YAML file of a map says.

    Attributes
    ----------
    image
        Path of the image, beside the YAML file unless absolute.
    resolution
        Side of a cell [m].
    origin
        Pose of the lower left corner of the lower left pixel [m, m, rad].
    mode, negate, occupied_thresh, free_thresh
        How grey becomes occupancy, see `cells_of`.
    """

    image: Path
    resolution: float
    origin: Pose2
    mode: Mode = "trinary"
    negate: bool = False
    occupied_thresh: float = TRINARY_OCCUPIED_THRESH
    free_thresh: float = TRINARY_FREE_THRESH


# ---------------------------------------------------------------------- reading
def read_map(path: AnyPath) -> OccupancyGrid:
    """Read a YAML file and the image that it names.

    Raises
    ------
    MapFileError
        Either file is missing, damaged, too large or contradictory.
    """
    description = read_description(path)
    try:
        raster = read_image(description.image)
    except MapFileError as error:
        raise MapFileError(f"{error} (the image of {Path(path).name})") from error
    cells = cells_of(
        raster,
        mode=description.mode,
        negate=description.negate,
        occupied_thresh=description.occupied_thresh,
        free_thresh=description.free_thresh,
    )
    return OccupancyGrid(cells, description.resolution, description.origin)


def read_bare_image(path: AnyPath, resolution: float) -> OccupancyGrid:
    """Read an image without a YAML file, as ROS 1 ``map_server IMAGE RESOLUTION`` does.

    Mode "trinary", thresholds 0.65 and 0.196, and the image's lower left corner is the origin.

    Raises
    ------
    MapFileError
        The image cannot be read, or `resolution` [m] is not a positive number.
    """
    if not (math.isfinite(resolution) and resolution > 0):
        raise MapFileError.of(path, f"the resolution must be a positive number of metres, not {resolution}")
    return OccupancyGrid(cells_of(read_image(path)), float(resolution))


def cells_of(
    raster: Raster,
    *,
    mode: Mode = "trinary",
    negate: bool = False,
    occupied_thresh: float = TRINARY_OCCUPIED_THRESH,
    free_thresh: float = TRINARY_FREE_THRESH,
) -> Cells:
    """Turn an image into occupancies [percent], -1 unknown, by nav2's rules.

    The brightness of a pixel is the mean of red, green and blue, 0..1; its occupancy is
    ``1 - brightness``, or the brightness itself if `negate` is set.

    - "trinary": over `occupied_thresh` 100, below `free_thresh` 0, else unknown. The opacity, if the
      image has it, takes part in the mean.
    - "scale": over `occupied_thresh` 100, below `free_thresh` 0, in between in proportion. Any
      transparency means unknown.
    - "raw": the brightness times 255 is the percentage; over 100 means unknown. Neither
      `negate` nor the thresholds count.

    Parameters
    ----------
    raster
        The image, row 0 at the top.
    mode, negate, occupied_thresh, free_thresh
        As above; the thresholds must differ in mode "scale".

    Returns
    -------
    Cells
        int8 (rows, cols), row 0 at the bottom, read-only.
    """
    samples = raster.samples
    rows, cols, channels = samples.shape
    with_alpha = raster.has_alpha and mode == "trinary"
    # A pixel's cell depends on nothing but the sum of its channels: look it up. Grey stands for
    # three equal colours, which matters only where opacity takes part in the mean.
    colours = 3 if channels >= 3 or with_alpha else 1
    wide = np.uint16 if raster.maxval == 255 else np.uint32
    table = _cell_of_sum(colours + with_alpha, raster.maxval, mode, negate, occupied_thresh, free_thresh)

    cells = np.empty((rows, cols), np.int8)
    step = max(1, _PIXELS_AT_ONCE // cols)
    for top in range(0, rows, step):
        block = samples[top : top + step][::-1]  # the only flip: images begin at the top
        sums: NDArray[np.unsignedinteger[Any]] = block[:, :, 0]
        if colours == 3:
            sums = sums.astype(wide)
            for channel in (1, 2) if channels >= 3 else (0, 0):
                sums += block[:, :, channel]
        if with_alpha:
            sums += block[:, :, -1]
        target = cells[max(rows - top - step, 0) : rows - top]
        np.take(table, sums, out=target, mode="clip")
        if raster.has_alpha and mode == "scale":
            target[block[:, :, -1] < raster.maxval] = UNKNOWN
    cells.flags.writeable = False
    return cells


def _cell_of_sum(
    summed: int, maxval: int, mode: Mode, negate: bool, occupied_thresh: float, free_thresh: float
) -> Cells:
    """Return the cell for every sum of `summed` samples of 0..maxval."""
    sums = np.arange(summed * maxval + 1, dtype=np.float64)
    shade = sums / summed / maxval
    if mode == "raw":
        scaled = shade * 255
        percent = np.floor(scaled) + (scaled - np.floor(scaled) >= 0.5)  # halves go up
        return np.where(percent <= OCCUPIED, percent, UNKNOWN).astype(np.int8)
    occupancy = shade if negate else 1 - shade
    between: NDArray[np.float64] | int = UNKNOWN
    if mode == "scale":
        between = np.rint((occupancy - free_thresh) / (occupied_thresh - free_thresh) * 100.0)
    cells = np.where(occupancy > occupied_thresh, OCCUPIED, np.where(occupancy < free_thresh, FREE, between))
    return cells.astype(np.int8)


# ---------------------------------------------------------------------- the YAML file, in
def read_description(path: AnyPath) -> MapDescription:
    """Read the YAML file of a map; the image is not looked at.

    ``image``, ``resolution`` and ``origin`` are required. Where nav2 requires more, this is lenient:
    ``negate`` is 0 if absent, and the thresholds those of ROS 1, 0.65 and 0.196, under which the
    usual greys (0, 205, 254) mean what they should. Unknown keys are passed over, as nav2 does.

    Raises
    ------
    MapFileError
        The file is not a map's YAML file, or a value is missing or makes no sense.
    """
    fields = _Fields(path)
    name = fields.text("image")
    if not name:
        fields.fail("its 'image' is empty; name the image file")
    mode = fields.text("mode", "trinary")
    if mode not in get_args(Mode):
        fields.fail(f"its 'mode' is {short(mode)}, not one of {', '.join(get_args(Mode))}")
    resolution = fields.number("resolution")
    if not (math.isfinite(resolution) and resolution > 0):
        fields.fail(f"its 'resolution' is {resolution}, not a positive number of metres")
    occupied_thresh = fields.number("occupied_thresh", TRINARY_OCCUPIED_THRESH)
    free_thresh = fields.number("free_thresh", TRINARY_FREE_THRESH)
    for key, value in (("occupied_thresh", occupied_thresh), ("free_thresh", free_thresh)):
        if not 0 <= value <= 1:
            fields.fail(f"its '{key}' is {value}, not between 0 and 1")
    # Equal thresholds leave no room to scale in, but split a black and white image well.
    if free_thresh > occupied_thresh or (free_thresh == occupied_thresh and mode == "scale"):
        fields.fail(
            f"its 'free_thresh' {free_thresh} is not below its 'occupied_thresh' {occupied_thresh};"
            " are they the wrong way round?"
        )
    origin = fields.pose("origin")
    problem = problem_of_origin(origin, resolution)
    if problem is not None:
        fields.fail(f"its {problem}")
    return MapDescription(
        image=Path(path).parent / name,
        resolution=resolution,
        origin=origin,
        mode=mode,  # type: ignore[arg-type]  # checked above
        negate=fields.flag("negate", False),
        occupied_thresh=occupied_thresh,
        free_thresh=free_thresh,
    )


def problem_of_origin(origin: Pose2, resolution: float) -> str | None:
    """Return what is wrong with an origin for cells of that size [m]; None if nothing is."""
    if math.ulp(max(abs(origin.x), abs(origin.y))) > resolution / 1000:
        return (
            f"origin [{origin.x}, {origin.y}, {origin.theta}] is too far from zero for cells of "
            f"{resolution} m: numbers of that size cannot tell the cells apart"
        )
    if abs(origin.theta) > MAX_ORIGIN_YAW:
        return f"origin has a yaw of {origin.theta} rad, beyond the {MAX_ORIGIN_YAW:,.0f} that are taken"
    return None


# YAML 1.2's numbers, as yaml-cpp reads and writes them. PyYAML knows YAML 1.1, where 1e-05 is a text.
_NUMBER = re.compile(
    r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)"
)
_FLAGS = {
    "true": True,
    "yes": True,
    "on": True,
    "y": True,
    "false": False,
    "no": False,
    "off": False,
    "n": False,
}


class _Fields:
    """The fields of a map's YAML file, by kind."""

    def __init__(self, path: AnyPath) -> None:
        self._path = path
        self._values = read_fields(path, "the YAML file of a map")

    def fail(self, problem: str) -> NoReturn:
        raise MapFileError.of(self._path, problem)

    def text(self, key: str, default: str | None = None) -> str:
        value = self._values.get(key)
        if value is None:
            if default is None:
                self._missing(key)
            return default
        if not isinstance(value, Scalar):
            self.fail(f"its '{key}' is not a text")
        return value.value

    def number(self, key: str, default: float | None = None) -> float:
        value = self._values.get(key)
        if value is None:
            if default is None:
                self._missing(key)
            return default
        return self._number(key, value)

    def flag(self, key: str, default: bool) -> bool:
        value = self._values.get(key)
        if value is None:
            return default
        if isinstance(value, Scalar) and not value.quoted:
            if value.value.lower() in _FLAGS:
                return _FLAGS[value.value.lower()]
            if re.fullmatch(r"[-+]?[0-9]{1,9}", value.value):
                return int(value.value) != 0
        self.fail(f"its '{key}' is not 0 or 1")

    def pose(self, key: str) -> Pose2:
        value = self._values.get(key)
        if value is None:
            self._missing(key)
        if not isinstance(value, list) or len(value) != 3:
            self.fail(f"its '{key}' is not a list of three numbers [x, y, yaw]")
        x, y, yaw = (self._number(key, item) for item in value)
        if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(yaw)):
            self.fail(f"its '{key}' is [{x}, {y}, {yaw}], but must be finite")
        return Pose2(x, y, yaw)

    def _number(self, key: str, value: Value) -> float:
        if not isinstance(value, Scalar):
            self.fail(f"its '{key}' is not a number")
        if _NUMBER.fullmatch(value.value) is None:
            self.fail(f"its '{key}' is {short(value.value)}, which is not a number")
        if value.quoted:
            self.fail(f"its '{key}' is the text {short(value.value)}; write the number without quotes")
        return float(re.sub(r"\.(?=[iInN])", "", value.value))

    def _missing(self, key: str) -> NoReturn:
        self.fail(f"has no '{key}', which the YAML file of a map must give")


# ---------------------------------------------------------------------- writing
def write_map(
    grid: OccupancyGrid,
    path: AnyPath,
    *,
    mode: Mode = "trinary",
    image_format: ImageFormat | None = None,
    force: bool = False,
    occupied_thresh: float | None = None,
    free_thresh: float | None = None,
) -> tuple[Path, Path]:
    """Write a map as a YAML file and an image beside it, as nav2's map_saver does.

    Resolution, origin and yaw are kept to the last bit. Of the cells,

    - "trinary" keeps three classes: at least `occupied_thresh` (0.65) becomes 100, at most
      `free_thresh` (0.25) 0, all else unknown. The file says 0.65 and 0.196 whatever these are, for
      they belong to the greys written (see `TRINARY_FREE_THRESH`). Exact for -1, 0 and 100.
    - "scale" keeps every percentage exactly with the default thresholds 1 and 0. With others,
      which are written as given, every reader stretches: p percent comes back as
      (p / 100 - free) / (occupied - free) of 100, cut to 0..100, within 0.2 / (occupied - free)
      percent and its rounding. Unknown is transparent. (ROS 1 rounds down, out of 99.)
    - "raw" keeps every percentage exactly, as the grey of that number; 255 is unknown.

    Parameters
    ----------
    grid, path, mode, image_format, force, occupied_thresh, free_thresh
        See `mapmeld.io.save`.

    Returns
    -------
    tuple of Path
        The YAML file and the image.

    Raises
    ------
    MapFileError
        See `mapmeld.io.save`.
    """
    yaml_path = Path(path)
    if yaml_path.suffix.lower() not in (".yaml", ".yml"):
        raise MapFileError.of(
            path, "a map is written as a .yaml file with an image beside it; end it in .yaml"
        )
    if mode not in get_args(Mode):
        raise MapFileError.of(path, f"there is no mode {mode!r}; choose from {', '.join(get_args(Mode))}")
    if image_format is None:
        image_format = "png" if mode == "scale" else "pgm"
    if image_format not in get_args(ImageFormat):
        raise MapFileError.of(path, f"images are written as pgm or png, not as {image_format!r}")
    if mode == "scale" and image_format == "pgm":
        raise MapFileError.of(path, "mode 'scale' writes unknown as transparent, which PGM cannot; use png")
    if occupied_thresh is None:
        occupied_thresh = 1.0 if mode == "scale" else OCCUPIED_THRESH
    if free_thresh is None:
        free_thresh = 0.0 if mode == "scale" else FREE_THRESH
    if not 0 <= free_thresh < occupied_thresh <= 1:
        raise MapFileError.of(
            path,
            f"0 <= free_thresh < occupied_thresh <= 1 is needed, not {free_thresh} and {occupied_thresh}",
        )
    if not 0 < grid.cells.size <= MAX_CELLS:
        raise MapFileError.of(
            path, f"the map has {grid.cells.size:,} cells; from 1 to {MAX_CELLS:,} can be written"
        )
    problem = problem_of_origin(grid.origin, grid.resolution)
    if problem is not None:  # the file could not be read again
        raise MapFileError.of(path, f"the map's {problem}")
    image_path = yaml_path.with_suffix(f".{image_format}")
    if not image_path.name.isprintable():
        raise MapFileError.of(
            path, "the name has characters that cannot be written into the file; choose another"
        )
    check_targets([image_path, yaml_path], force=force)

    image = _image_of(grid.cells, mode, occupied_thresh, free_thresh)
    if mode == "trinary":
        occupied_thresh, free_thresh = TRINARY_OCCUPIED_THRESH, TRINARY_FREE_THRESH
    text = _yaml_text(grid, image_path.name, mode, occupied_thresh, free_thresh)
    pieces = pgm_pieces(image) if image_format == "pgm" else png_pieces(image, path)
    # The YAML file last: a reader that finds it finds a whole map.
    write_files([(image_path, pieces), (yaml_path, (text.encode(),))], force=force)
    return yaml_path, image_path


def _image_of(cells: Cells, mode: Mode, occupied_thresh: float, free_thresh: float) -> NDArray[np.uint8]:
    """Return the grey (rows, cols), or in mode "scale" BGRA (rows, cols, 4), image of a map."""
    percent = np.arange(OCCUPIED + 1)
    if mode == "scale":
        # Four channels though two would do: nav2's image library does not read grey with opacity well.
        pixel = np.full((256, 4), 255, np.uint8)
        pixel[: OCCUPIED + 1, :3] = np.rint((100 - percent) / 100 * 255)[:, None]
        pixel[OCCUPIED + 1 :] = (128, 128, 128, 0)
        flipped = np.take(pixel.view(np.uint32).reshape(-1), cells.view(np.uint8)[::-1])
        return flipped.view(np.uint8).reshape(*cells.shape, 4)
    grey = np.full(256, 255 if mode == "raw" else UNKNOWN_GREY, np.uint8)  # -1 is entry 255
    if mode == "raw":
        grey[: OCCUPIED + 1] = percent
    else:
        grey[: OCCUPIED + 1][percent >= round(occupied_thresh * 100)] = OCCUPIED_GREY
        grey[: OCCUPIED + 1][percent <= round(free_thresh * 100)] = FREE_GREY
    image: NDArray[np.uint8] = np.take(grey, cells.view(np.uint8)[::-1])
    return image


def _yaml_text(
    grid: OccupancyGrid, image: str, mode: Mode, occupied_thresh: float, free_thresh: float
) -> str:
    plain = re.fullmatch(r"[A-Za-z_][\w.-]*", image, re.ASCII) is not None
    origin = ", ".join(map(_exact, (grid.origin.x, grid.origin.y, grid.origin.theta)))
    return (
        f"image: {image if plain else json.dumps(image, ensure_ascii=False)}\n"
        f"mode: {mode}\n"
        f"resolution: {_exact(grid.resolution)}\n"
        f"origin: [{origin}]\n"
        "negate: 0\n"
        f"occupied_thresh: {_exact(occupied_thresh)}\n"
        f"free_thresh: {_exact(free_thresh)}\n"
    )


def _exact(number: float) -> str:
    """Return the shortest text that reads back as the same number in YAML 1.1 and 1.2."""
    text = repr(float(number))
    # YAML 1.1 takes 1e-07 for a word; it wants a dot.
    return text if "." in text else text.replace("e", ".0e")
