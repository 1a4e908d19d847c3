"""Every step of the alphabet method in pictures, for the user's own maps (paper, Figures 1 to 8)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapmeld.grid import FREE, OCCUPIED, OccupancyGrid, resample
from mapmeld.matching import MatchResult, Verdict, match
from mapmeld.matching.alphabet import (
    Alphabet,
    AlphabetParameters,
    MapMatching,
    binarise,
    blur_clutter,
    map_matching,
    thicken_walls,
    thin_walls,
)
from mapmeld.matching.drawn_walls import BLACK, WHITE, Image
from mapmeld.merging import merge_aligned
from mapmeld.report.canvas import (
    GREYS,
    Canvas,
    Labels,
    Picture,
    Window,
    grey_labels,
    paint,
    whole_scale,
    with_turn,
)
from mapmeld.report.heatmap import with_gamma
from mapmeld.report.marks import with_dots, with_labels
from mapmeld.report.overlay import overlay
from mapmeld.report.palette import (
    BLUE,
    FAINT,
    FLOOR_WHITE,
    FRAME,
    GREEN,
    INK,
    PAIR_COLOURS,
    RED,
    WALL_BLACK,
    Colour,
)
from mapmeld.report.references import references
from mapmeld.report.sheet import Panel, compose
from mapmeld.report.stars import common_relations, with_star
from mapmeld.se2 import Pose2, wrap_angle

_PANEL_PX = 800  # long side of one map where two are shown together

FIGURE_NAMES = (
    "01_maps.png",
    "02_binarised.png",
    "03_eroded_twice.png",
    "04_dilated_twice.png",
    "05_eroded.png",
    "06_median.png",
    "07_dilated.png",
    "08_corners.png",
    "09_first_letters.png",
    "10_second_letters.png",
    "11_gamma.png",
    "12_intersection.png",
    "13_union.png",
    "14_merged.png",
    "15_overlay.png",
)
"""The file names that `explain` gives for an accepted match, in order."""

_ALWAYS = 8  # pictures that show the way to the corners, which no pair of maps stops on

POSSIBLE_NAMES = tuple(
    f"{number:02}_{name[3:]}"
    for position, name in enumerate(FIGURE_NAMES, start=1)
    for number in range(min(position, _ALWAYS + 1), position + 1)
)
"""Every file name that `explain` may give: where steps are missing, the later ones count on without them."""


@dataclass(frozen=True, slots=True, eq=False)
class Figure:
    """One step of the method.

    Attributes
    ----------
    name
        File name, which begins with the number of the picture.
    picture
        Blue-green-red, row 0 at the top.
    caption
        What is to be seen, in one sentence; also below the picture.
    """

    name: str
    picture: Picture
    caption: str


@dataclass(frozen=True, slots=True)
class Explanation:
    """How the alphabet method came to its answer.

    Attributes
    ----------
    result
        The answer.
    figures
        The steps in order. Those that the method did not reach (no corners, no candidate) are
        missing, and so is the merged map unless the match was accepted; the numbers have no gaps.
    """

    result: MatchResult
    figures: tuple[Figure, ...]


def explain(
    a: OccupancyGrid,
    b: OccupancyGrid,
    parameters: AlphabetParameters | None = None,
    names: tuple[str, str] = ("a", "b"),
) -> Explanation:
    """Match two maps by the alphabet method and draw every step of it.

    Parameters
    ----------
    a, b
        The maps.
    parameters
        Settings; None for the paper's.
    names
        What to call the maps below the pictures.
    """
    p = parameters or AlphabetParameters()
    result = match(a, b, "alphabet", p)
    matching = map_matching(a, b, p)
    pair = _Pair.of(matching, names)
    figures = [
        *_preprocessing(pair, p),
        *_alphabets(pair, matching, p),
        *_fitting(pair, matching),
        *_answer((a, b), names, result),
    ]
    numbered = (
        replace(figure, name=f"{number:02}_{figure.name[3:]}")
        for number, figure in enumerate(figures, start=1)
    )
    return Explanation(result, tuple(numbered))


# ---------------------------------------------------------------------- two maps at one scale
@dataclass(frozen=True, slots=True)
class _Pair:
    """The two maps at their common resolution, shown beside each other at the same scale."""

    maps: tuple[OccupancyGrid, OccupancyGrid]
    names: tuple[str, str]
    windows: tuple[Window, Window]
    px_per_cell: float

    @classmethod
    def of(cls, matching: MapMatching, names: tuple[str, str]) -> _Pair:
        windows = [Window.around(g.shape, g.known, 2 + max(g.shape) // 50) for g in matching.maps]
        scale = whole_scale(max(max(w.rows, w.cols) for w in windows), _PANEL_PX)
        titles = (f"a: {names[0]}", f"b: {names[1]}")
        return cls(matching.maps, titles, (windows[0], windows[1]), scale)

    def paint(self, labels: Sequence[Labels], palette: Sequence[Colour]) -> list[Canvas]:
        return [
            paint(label, palette, window, self.px_per_cell)
            for label, window in zip(labels, self.windows, strict=True)
        ]

    def figure(
        self, name: str, canvases: Sequence[Canvas], caption: str, legend: Sequence[tuple[Colour, str]] = ()
    ) -> Figure:
        panels = [Panel(c.picture, title) for c, title in zip(canvases, self.names, strict=True)]
        px_per_metre = self.px_per_cell / self.maps[0].resolution
        return Figure(name, compose(panels, caption, legend, px_per_metre), caption)


# ---------------------------------------------------------------------- step 1
_BLACK_ON_WHITE = (FLOOR_WHITE, WALL_BLACK)
_CHANGES = (FLOOR_WHITE, WALL_BLACK, RED, GREEN)  # white, black, turned white, turned black


def _preprocessing(pair: _Pair, p: AlphabetParameters) -> list[Figure]:
    stages = _Stages(pair)
    figures = [
        pair.figure(
            "01_maps.png",
            pair.paint([grey_labels(grid) for grid in pair.maps], GREYS),
            f"The maps as the method gets them, at {pair.maps[0].resolution:g} m per cell: "
            "obstacles black, floor white, unknown grey.",
        ),
        stages.figure("02_binarised.png", "Binarised: obstacles black, all else white, the unknown too."),
    ]
    stages.apply(lambda image: thicken_walls(image, 2))
    figures.append(
        stages.figure("03_eroded_twice.png", "Two erosions of the white thicken the walls and close gaps.")
    )
    stages.apply(lambda image: thin_walls(image, 2))
    figures.append(
        stages.changes(
            "04_dilated_twice.png",
            "Two dilations make the walls as thin as before; gaps that were closed stay closed.",
            "02",
        )
    )
    stages.apply(lambda image: thicken_walls(image, 1))
    figures.append(stages.figure("05_eroded.png", "One more erosion, before the median blur."))
    stages.apply(lambda image: blur_clutter(image, p.median_px))
    figures.append(
        stages.figure(
            "06_median.png", f"Median blur of {p.median_px} x {p.median_px} px: specks go, walls stay."
        )
    )
    stages.apply(lambda image: thin_walls(image, 1))
    figures.append(
        stages.changes(
            "07_dilated.png", "One dilation; this is what corners and similarity are taken from.", "04"
        )
    )
    return figures


class _Stages:
    """The images of both maps on their way through the preprocessing."""

    def __init__(self, pair: _Pair) -> None:
        self._pair = pair
        self._images = [_binary(grid) for grid in pair.maps]
        self._before = list(self._images)

    def apply(self, step: Callable[[Image], Image]) -> None:
        self._images = [step(image) for image in self._images]

    def figure(self, name: str, caption: str) -> Figure:
        labels = [(image == BLACK).astype(np.uint8) for image in self._images]
        return self._pair.figure(name, self._pair.paint(labels, _BLACK_ON_WHITE), caption)

    def changes(self, name: str, caption: str, since: str) -> Figure:
        """Colour what has changed since picture `since`, the last one that changes were shown in."""
        labels = []
        for before, after in zip(self._before, self._images, strict=True):
            label = (after == BLACK).astype(np.uint8)
            label[(before == BLACK) & (after == WHITE)] = 2
            label[(before == WHITE) & (after == BLACK)] = 3
            labels.append(label)
        self._before = list(self._images)
        legend = [(GREEN, f"turned black since {since}"), (RED, f"turned white since {since}")]
        legend = [
            entry for entry, n in zip(legend, (3, 2), strict=True) if any((x == n).any() for x in labels)
        ]
        return self._pair.figure(name, self._pair.paint(labels, _CHANGES), caption, legend)


def _binary(grid: OccupancyGrid) -> Image:
    return binarise(grid) if grid.cells.size else np.full((1, 1), WHITE, np.uint8)


# ---------------------------------------------------------------------- steps 2 to 5
def _alphabets(pair: _Pair, matching: MapMatching, p: AlphabetParameters) -> list[Figure]:
    walls = [(image == BLACK).astype(np.uint8) for image in matching.preprocessed]
    canvases = [
        with_labels(
            with_dots(canvas, alphabet.corners_px, RED, 4),
            alphabet.corners_px,
            [str(n + 1) for n in range(len(alphabet.corners_px))],
            INK,
        )
        for canvas, alphabet in zip(pair.paint(walls, (FLOOR_WHITE, FRAME)), matching.alphabets, strict=True)
    ]
    first, second = matching.alphabets
    figures = [
        pair.figure(
            "08_corners.png",
            canvases,
            f"Good features to track: {len(first.corners_px)} corners in a, {len(second.corners_px)} in b, "
            "numbered from the strongest to the weakest.",
        )
    ]
    best = matching.fittings[0] if matching.fittings else None
    if best is not None:
        for name, which, point in (
            ("09_first_letters.png", "first", best.candidate.first),
            ("10_second_letters.png", "second", best.candidate.second),
        ):
            figures.append(_letters(name, which, point, best.T_1_2_px, pair, matching, p))
    if matching.gamma.size:
        canvas = with_gamma(matching.gamma, matching.candidates, best.candidate if best else None)
        caption = (
            "The matrix gamma: in how many ways two relations of a corner of a agree with two of a "
            f"corner of b; white is none, the darkest is {int(matching.gamma.max())}."
        )
        legend = [(BLUE, "first point of a candidate")]
        if best:
            legend.append((GREEN, "the two matching points of the best fitting"))
        panel = Panel(canvas.picture, "rows: corners of a; columns: corners of b")
        figures.append(Figure("11_gamma.png", compose([panel], caption, legend), caption))
    return figures


def _letters(
    name: str,
    which: str,
    point: tuple[int, int],
    T_1_2_px: Pose2,
    pair: _Pair,
    matching: MapMatching,
    p: AlphabetParameters,
) -> Figure:
    common = common_relations(*matching.alphabets, point, T_1_2_px.theta, p)
    walls = [(image == BLACK).astype(np.uint8) for image in matching.preprocessed]
    canvases = [
        with_star(canvas, alphabet, letter, [relations[side] for relations in common])
        for side, (canvas, alphabet, letter) in enumerate(
            zip(pair.paint(walls, (FLOOR_WHITE, FRAME)), matching.alphabets, point, strict=True)
        )
    ]
    i, z = point
    relations = [_relations(alphabet, n) for alphabet, n in zip(matching.alphabets, point, strict=True)]
    caption = (
        f"Letter {i + 1} of a and letter {z + 1} of b, the {which} matching point of the best fitting: of "
        f"their {relations[0]} and {relations[1]} relations, {len(common)} agree in length and, after the "
        f"turn of the pixels by {_turn(T_1_2_px, pair.maps)}, in direction (gamma {matching.gamma[i, z]})."
    )
    legend = [(PAIR_COLOURS[0], "agrees, each in its own colour"), (FAINT, "has no partner")]
    return pair.figure(name, canvases, caption, legend)


def _turn(T_1_2_px: Pose2, maps: tuple[OccupancyGrid, OccupancyGrid]) -> str:
    """Name the turn between two lattices and, where one of them has a yaw, that between the frames."""
    pixels = f"{math.degrees(T_1_2_px.theta):.1f} degrees"
    yaws = [math.degrees(wrap_angle(grid.origin.theta)) for grid in maps]
    if all(round(yaw, 1) == 0 for yaw in yaws):
        return pixels
    theta = wrap_angle(maps[0].origin.theta + T_1_2_px.theta - maps[1].origin.theta)
    return (
        f"{pixels} (theta {math.degrees(theta):.1f} degrees between the frames, in which the pixels of a are "
        f"turned by {yaws[0]:.1f} and those of b by {yaws[1]:.1f} degrees)"
    )


def _relations(alphabet: Alphabet, letter: int) -> int:
    return int(np.count_nonzero(alphabet.letter == letter))


# ---------------------------------------------------------------------- step 6
def _fitting(pair: _Pair, matching: MapMatching) -> list[Figure]:
    if not matching.fittings:
        return []
    best = matching.fittings[0]
    first, second = (_lattice_map(image) for image in matching.preprocessed)
    both = merge_aligned([first, second], [Pose2(), best.T_1_2_px])
    black_1 = resample(first, Pose2(), both) == OCCUPIED
    black_2 = resample(second, best.T_1_2_px, both) == OCCUPIED
    window = Window.around(both.shape, black_1 | black_2, 2 + max(both.shape) // 50)
    figures = []
    for name, what, mask in (
        ("12_intersection.png", "Intersection: pixels that are black in both maps", black_1 & black_2),
        ("13_union.png", "Union: pixels that are black in either map", black_1 | black_2),
    ):
        canvas = paint(mask.astype(np.uint8), _BLACK_ON_WHITE, window)
        caption = (
            f"{what} under the best of {len(matching.fittings)} fittings; "
            f"intersection over union, the Jaccard similarity, is {best.similarity:.3f}."
        )
        px_per_metre = canvas.px_per_cell / pair.maps[0].resolution
        figures.append(Figure(name, compose([Panel(canvas.picture)], caption, (), px_per_metre), caption))
    return figures


def _lattice_map(image: Image) -> OccupancyGrid:
    """Return a preprocessed image as a map whose metres are its pixels."""
    return OccupancyGrid(np.where(image == BLACK, OCCUPIED, FREE).astype(np.int8), 1.0)


# ---------------------------------------------------------------------- step 7
def _answer(
    maps: tuple[OccupancyGrid, OccupancyGrid], names: tuple[str, str], result: MatchResult
) -> list[Figure]:
    if result.T_a_b is None:
        return []
    poses = [Pose2(), result.T_a_b]
    figures = []
    if result.verdict is Verdict.ACCEPTED:
        caption = (
            "The merged map in the frame of map a, with the global reference of each robot: "
            f"b lies at {result.T_a_b}."
        )
        picture = references(merge_aligned(maps, poses), poses, names, caption)
        figures.append(Figure("14_merged.png", picture, with_turn(caption, maps[0])))
        caption = (
            "Map b laid over map a under the transform that was found; walls agree where they are green."
        )
    else:
        caption = f"The best guess, {result.verdict}, so not merged: {result.T_a_b}."
    picture = overlay(maps, poses, [f"a: {names[0]}", f"b: {names[1]}"], caption)
    figures.append(Figure("15_overlay.png", picture, with_turn(caption, maps[0])))
    return figures
