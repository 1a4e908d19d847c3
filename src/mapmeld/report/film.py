"""The merge growing, state by state: a strip of pictures, or an animation."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from mapmeld.grid import Cells, OccupancyGrid, resample
from mapmeld.history.step import Step
from mapmeld.io.atomic import check_targets, write_files
from mapmeld.merging.aligned import lattice_for_all
from mapmeld.report.canvas import Picture, Window, paint, whole_scale
from mapmeld.report.overlay import overlay_labels
from mapmeld.report.palette import BLUE, FLOOR_WHITE, GREEN, PAPER, RED, UNKNOWN_GREY, Colour
from mapmeld.report.png import PictureError
from mapmeld.report.sheet import Panel, compose
from mapmeld.se2 import Pose2

FRAMES = 48  # of an animation, at most
STRIP_FRAMES = 6
FRAME_MS, LAST_MS = 300, 2500
_NO_DITHER = 3  # there are few colours, none of which shall be mixed from others
_STRIP_PX, _GIF_PX = 320, 400  # long side of a panel that is aimed at
_LEGEND = [(RED, "walls of map 1"), (BLUE, "walls of map 2"), (GREEN, "walls in both")]


class Film:
    """Steps to draw, in order; of many it keeps some, evenly spread, so that memory stays bounded."""

    def __init__(self) -> None:
        self._kept: list[Step] = []
        self._every = 1
        self._last: Step | None = None

    def take(self, step: Step) -> None:
        """Take the next step; those without both maps have nothing to draw."""
        if None in step.maps:
            return
        self._last = step
        if step.number % self._every:
            return
        self._kept.append(step)
        if len(self._kept) > FRAMES:
            self._every *= 2
            self._kept = [kept for kept in self._kept if kept.number % self._every == 0]

    def steps(self) -> list[Step]:
        """Return what is kept, with the last step in any case."""
        if self._last is None or (self._kept and self._kept[-1] is self._last):
            return self._kept
        return [*self._kept, self._last]


def strip(film: Film) -> Picture:
    """Draw some of the steps in a row: above, what lies in the frame of map 1; below, map 2 in its own.

    Raises
    ------
    PictureError
        There was never a map of both.
    """
    steps = film.steps()
    chosen = sorted({round(k) for k in np.linspace(0, len(steps) - 1, STRIP_FRAMES)}) if steps else []
    scenes = _scenes([steps[k] for k in chosen], _STRIP_PX)
    caption = "Above: the frame of map 1; map 2 lies in it while the match is accepted. Below: map 2 alone."
    return compose([Panel(_below(scene), scene.text) for scene in scenes], caption, _LEGEND)


def frames(film: Film) -> list[Picture]:
    """Draw every step that is kept; all pictures have one size.

    Raises
    ------
    PictureError
        There was never a map of both.
    """
    pictures = [
        compose([Panel(scene.merge, "the frame of map 1"), Panel(scene.second, "map 2")], scene.text, _LEGEND)
        for scene in _scenes(film.steps(), _GIF_PX)
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
    animation = cv2.Animation()
    animation.frames = list(pictures)
    animation.durations = [*([FRAME_MS] * (len(pictures) - 1)), LAST_MS]
    settings = [cv2.IMWRITE_GIF_DITHER, _NO_DITHER]
    done, data = cv2.imencodeanimation(".gif", animation, settings)
    if not done:
        raise PictureError(f"{os.fspath(path)}: OpenCV could not encode the animation")
    write_files([(path, (np.asarray(data, dtype=np.uint8).tobytes(),))], force=force)
    return Path(path)


# ---------------------------------------------------------------------- one step drawn
@dataclass(frozen=True, slots=True, eq=False)
class _Scene:
    """One step: the frame of map 1 with what lies in it, map 2 alone, and words."""

    merge: Picture
    second: Picture
    text: str


def _scenes(steps: Sequence[Step], long_side_px: int) -> list[_Scene]:
    """Draw steps in windows that all of them share."""
    pairs = [(step, *_both(step)) for step in steps]
    if not pairs:
        raise PictureError("nothing to draw: there was never a map of both processes")
    merges = _layers([[(first, Pose2()), (second, step.T_1_2)] for step, first, second in pairs])
    seconds = _layers([[(second, Pose2())] for _, _, second in pairs])
    windows = [_window(drawn) for drawn in (merges, seconds)]
    scale = whole_scale(max(max(window.rows, window.cols) for window in windows), long_side_px)
    begin = next((step.stamp for step, *_ in pairs if step.stamp is not None), None)
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
    lattice = lattice_for_all([grid for grid, _ in everything], [T for _, T in everything])
    return [[resample(grid, T, lattice) for grid, T in scene] for scene in placed]


def _window(scenes: Sequence[Sequence[Cells]]) -> Window:
    """Return the window of all that is known in any scene."""
    known = np.logical_or.reduce([layer >= 0 for scene in scenes for layer in scene])
    return Window.around((known.shape[0], known.shape[1]), known, margin=2)


def _painted(layers: Sequence[Cells], colour: Colour, window: Window, scale: float) -> Picture:
    walls = [colour, BLUE] if len(layers) == 2 else [colour]
    return paint(overlay_labels(layers), [UNKNOWN_GREY, FLOOR_WHITE, *walls, GREEN], window, scale).picture


def _text(step: Step, begin: float | None) -> str:
    when = f"state {step.number}" if step.stamp is None or begin is None else f"{step.stamp - begin:.1f} s"
    probability = None if step.best is None else step.best.probability
    return f"{when}: {step.standing}" + ("" if probability is None else f", {probability:.2f}")


def _below(scene: _Scene) -> Picture:
    """Return map 2 below the merge."""
    width = max(scene.merge.shape[1], scene.second.shape[1])
    gap = np.full((6, width, 3), PAPER, np.uint8)
    return np.concatenate([_widened(scene.merge, width), gap, _widened(scene.second, width)])


def _widened(picture: Picture, width: int) -> Picture:
    side = np.full((len(picture), width - picture.shape[1], 3), PAPER, np.uint8)
    return np.concatenate([picture, side], axis=1)


def _padded(picture: Picture, height: int) -> Picture:
    below = np.full((height - len(picture), picture.shape[1], 3), PAPER, np.uint8)
    return np.concatenate([picture, below])
