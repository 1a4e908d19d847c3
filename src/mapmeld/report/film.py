"""The merge growing, state by state: a strip of pictures, or an animation."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from mapmeld.grid import Cells, OccupancyGrid, at_resolution, resample
from mapmeld.history.step import Change, Step, Work
from mapmeld.io.atomic import check_targets, write_files
from mapmeld.matching.per_map import PerMap
from mapmeld.merging.aligned import lattice_for_all
from mapmeld.report.canvas import Picture, Window, paint, whole_scale
from mapmeld.report.overlay import overlay_labels
from mapmeld.report.palette import BLUE, FLOOR_WHITE, GREEN, PAPER, RED, UNKNOWN_GREY, Colour
from mapmeld.report.png import PictureError
from mapmeld.report.sheet import Panel, compose
from mapmeld.se2 import Pose2
from mapmeld.wording import probability_text, rounded

FRAMES = 48  # of an animation, at most
STRIP_FRAMES = 6
TURNS = STRIP_FRAMES - 2  # beside the first and the last
FRAME_MS, LAST_MS = 300, 2500
_NO_DITHER = 3  # there are few colours, none of which shall be mixed from others
_STRIP_PX, _GIF_PX = 320, 400  # long side of a panel that is aimed at
_MOST_CELLS = 2 * _GIF_PX  # along a side, of a map that is kept and of what is drawn; finer is not shown
_MOST_SHRUNK = 20  # times; pictures of more would show dots, far apart
_NARROWEST = 200  # [px] of a panel: room for the longest word below it
_TURNING = (Change.FOUND, Change.SWITCHED, Change.WITHDRAWN)
_LEGEND = [(RED, "walls of map 1"), (BLUE, "walls of map 2"), (GREEN, "walls in both")]


class Film:
    """Steps to draw, in order; of many it keeps some, evenly spread, with maps no finer than is drawn.

    So memory stays bounded, however many states there are and however large they grow. Where a match was
    found, switched or withdrawn is kept besides: the first such step and the newest ones.

    Attributes
    ----------
    begin
        Time of the first state of either process [s], from which times count; None without stamps.
    """

    def __init__(self) -> None:
        self.begin: float | None = None
        self._kept: list[tuple[int, Step]] = []
        self._every = 1
        self._count = 0
        self._turns: list[Step] = []
        self._last: Step | None = None

    def take(self, step: Step) -> None:
        """Take the next step; those without both maps, or with maps as they were, have nothing to draw."""
        self.begin = step.stamp if self.begin is None else self.begin
        as_it_was = self._last is not None and step.work is Work.NOTHING
        if None in step.maps or as_it_was:
            return
        step = _kept_small(step)
        self._last = step
        if step.change in _TURNING:
            self._turns.append(step)
            if len(self._turns) > TURNS:
                del self._turns[1]
        self._count += 1
        if self._count % self._every:
            return
        self._kept.append((self._count, step))
        if len(self._kept) > FRAMES:
            self._every *= 2
            self._kept = [kept for kept in self._kept if kept[0] % self._every == 0]

    def steps(self) -> list[Step]:
        """Return what is kept, with the last step in any case."""
        last = [] if self._last is None else [self._last]
        kept = {step.number: step for step in (*(step for _, step in self._kept), *self._turns, *last)}
        return [kept[number] for number in sorted(kept)]

    def moments(self) -> list[Step]:
        """Return a few steps for a strip: first, last, what the match went through, and some between."""
        steps = self.steps()
        if len(steps) <= STRIP_FRAMES:
            return steps
        chosen = {step.number: step for step in (steps[0], steps[-1], *self._turns)}
        while len(chosen) < STRIP_FRAMES:  # each where the gap is widest
            rest = [step for step in steps if step.number not in chosen]
            farthest = max(rest, key=lambda step: min(_apart(step, other) for other in chosen.values()))
            chosen[farthest.number] = farthest
        return [chosen[number] for number in sorted(chosen)]


def _kept_small(step: Step) -> Step:
    first, second = _both(step)
    return replace(step, maps=(_small(first), _small(second)))


def _small(grid: OccupancyGrid) -> OccupancyGrid:
    return grid if max(grid.shape) <= _MOST_CELLS else _shrunk(grid)


@PerMap
def _shrunk(grid: OccupancyGrid) -> OccupancyGrid:
    known = grid.cropped()
    return at_resolution(known, known.resolution * max(1.0, max(known.shape) / _MOST_CELLS))


def _apart(one: Step, other: Step) -> float:
    """Return how far apart two steps are: in time, or in states where there are no times."""
    if one.stamp is None or other.stamp is None:
        return abs(one.number - other.number)
    return abs(one.stamp - other.stamp)


def strip(film: Film) -> Picture:
    """Draw some of the steps in a row: above, what lies in the frame of map 1; below, map 2 in its own.

    Raises
    ------
    PictureError
        There was never a map of both, or maps lie too far apart for one picture.
    """
    scenes = _scenes(film.moments(), film.begin, _STRIP_PX)
    caption = "Above: the frame of map 1; map 2 lies in it while the match is accepted. Below: map 2 alone."
    return compose([Panel(_below(scene), scene.text) for scene in scenes], caption, _LEGEND)


def frames(film: Film) -> list[Picture]:
    """Draw every step that is kept; all pictures have one size.

    Raises
    ------
    PictureError
        There was never a map of both, or maps lie too far apart for one picture.
    """
    pictures = [
        compose(
            [Panel(_roomy(scene.merge), "the frame of map 1"), Panel(_roomy(scene.second), "map 2")],
            scene.text,
            _LEGEND,
        )
        for scene in _scenes(film.steps(), film.begin, _GIF_PX)
    ]
    height = max(len(picture) for picture in pictures)
    return [_padded(picture, height) for picture in pictures]


def check_gif_path(path: str | os.PathLike[str], *, force: bool = False) -> None:
    """Find out, before the work, that an animation could not be written.

    Raises
    ------
    PictureError
        The name does not end in ``.gif``, or this OpenCV writes none.
    MapFileError
        The file exists (and `force` is not set) or its folder does not.
    """
    if Path(path).suffix.lower() != ".gif":
        raise PictureError(
            f"{os.fspath(path)}: an animation is written as GIF; choose a name that ends in .gif"
        )
    if not hasattr(cv2, "imencodeanimation"):
        raise PictureError(
            f"{os.fspath(path)}: OpenCV {cv2.__version__} writes no GIF; draw a strip, or "
            "pip install -U opencv-python-headless"
        )
    check_targets([path], force=force)


def write_gif(pictures: Sequence[Picture], path: str | os.PathLike[str], *, force: bool = False) -> Path:
    """Write pictures of one size as an animation that repeats, whole or not at all; return the path.

    Raises
    ------
    PictureError, MapFileError
        As `check_gif_path`, or the disk refuses.
    """
    check_gif_path(path, force=force)
    write_files([(path, (gif_bytes(pictures),))], force=force)
    return Path(path)


def gif_bytes(pictures: Sequence[Picture]) -> bytes:
    """Return the content of a GIF file.

    Raises
    ------
    PictureError
        OpenCV fails.
    """
    animation = cv2.Animation()
    animation.frames = list(pictures)
    animation.durations = [*([FRAME_MS] * (len(pictures) - 1)), LAST_MS]
    settings = [cv2.IMWRITE_GIF_DITHER, _NO_DITHER]
    done, data = cv2.imencodeanimation(".gif", animation, settings)
    if not done:
        raise PictureError("OpenCV could not encode the animation")
    return np.asarray(data, dtype=np.uint8).tobytes()


# ---------------------------------------------------------------------- one step drawn
@dataclass(frozen=True, slots=True, eq=False)
class _Scene:
    """One step: the frame of map 1 with what lies in it, map 2 alone, and words."""

    merge: Picture
    second: Picture
    text: str


def _scenes(steps: Sequence[Step], begin: float | None, long_side_px: int) -> list[_Scene]:
    """Draw steps in windows that all of them share; their times count from `begin` [s]."""
    pairs = [(step, *_both(step)) for step in steps]
    if not pairs:
        raise PictureError("nothing to draw: there was never a map of both processes")
    merges = _layers([[(first, Pose2()), (second, step.T_1_2)] for step, first, second in pairs])
    seconds = _layers([[(second, Pose2())] for _, _, second in pairs])
    windows = [_window(drawn) for drawn in (merges, seconds)]
    scale = whole_scale(max(max(window.rows, window.cols) for window in windows), long_side_px)
    return [
        _Scene(
            merge=_painted(merge, RED, windows[0], scale),
            second=_painted(second, BLUE, windows[1], scale),
            text=_text(step, begin),
        )
        for (step, *_), merge, second in zip(pairs, merges, seconds, strict=True)
    ]


def _both(step: Step) -> tuple[OccupancyGrid, OccupancyGrid]:
    first, second = step.maps
    assert first is not None
    assert second is not None
    return first, second


def _layers(scenes: Sequence[Sequence[tuple[OccupancyGrid, Pose2 | None]]]) -> list[list[Cells]]:
    """Return the cells of all that is placed in each scene, all on one lattice."""
    placed = [[(grid, T) for grid, T in scene if T is not None] for scene in scenes]
    everything = [item for scene in placed for item in scene]
    resolution = _drawn_resolution(everything)
    coarse = [[(_no_finer(grid, resolution), T) for grid, T in scene] for scene in placed]
    everything = [item for scene in coarse for item in scene]
    lattice = lattice_for_all([grid for grid, _ in everything], [T for _, T in everything])
    return [[resample(grid, T, lattice) for grid, T in scene] for scene in coarse]


def _drawn_resolution(placed: Sequence[tuple[OccupancyGrid, Pose2]]) -> float:
    """Return the side of a cell [m]: that of the first map, or larger, so that a picture holds them all."""
    first = placed[0][0]
    reached = []
    for grid, T in placed:
        rows, cols = grid.shape
        corners = grid.lattice_to_metres([(0, 0), (cols, 0), (0, rows), (cols, rows)])
        reached.append(first.metres_to_lattice(T.apply(corners)))
    corners = np.concatenate(reached)
    times = max(1.0, float(np.ptp(corners, axis=0).max()) / _MOST_CELLS)
    if times > _MOST_SHRUNK:
        raise PictureError("the maps lie too far apart, over all states, for one picture")
    return first.resolution * times


def _no_finer(grid: OccupancyGrid, resolution: float) -> OccupancyGrid:
    return grid if grid.resolution >= resolution else at_resolution(grid, resolution)


def _window(scenes: Sequence[Sequence[Cells]]) -> Window:
    """Return the window of all that is known in any scene."""
    known = np.logical_or.reduce([layer >= 0 for scene in scenes for layer in scene])
    return Window.around((known.shape[0], known.shape[1]), known, margin=2)


def _painted(layers: Sequence[Cells], colour: Colour, window: Window, scale: float) -> Picture:
    walls = [colour, BLUE] if len(layers) == 2 else [colour]
    return paint(overlay_labels(layers), [UNKNOWN_GREY, FLOOR_WHITE, *walls, GREEN], window, scale).picture


def _text(step: Step, begin: float | None) -> str:
    when = f"state {step.number}"
    if step.stamp is not None and begin is not None:
        when = f"{rounded(step.stamp - begin, 1)} s"
    found = step.best if step.best is not None and step.best.T_a_b is not None else None
    if found is None or found.probability is None:
        return f"{when}: {step.standing}"
    words = probability_text(found.probability)
    return f"{when}: {step.standing}, p " + (words if words[0] in "<>" else f"= {words}")


def _below(scene: _Scene) -> Picture:
    """Return map 2 below the merge."""
    width = max(scene.merge.shape[1], scene.second.shape[1], _NARROWEST)
    gap = np.full((6, width, 3), PAPER, np.uint8)
    return np.concatenate([_widened(scene.merge, width), gap, _widened(scene.second, width)])


def _roomy(picture: Picture) -> Picture:
    return _widened(picture, max(picture.shape[1], _NARROWEST))


def _widened(picture: Picture, width: int) -> Picture:
    side = np.full((len(picture), width - picture.shape[1], 3), PAPER, np.uint8)
    return np.concatenate([picture, side], axis=1)


def _padded(picture: Picture, height: int) -> Picture:
    below = np.full((height - len(picture), picture.shape[1], 3), PAPER, np.uint8)
    return np.concatenate([picture, below])
