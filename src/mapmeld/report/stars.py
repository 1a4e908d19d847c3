"""Letters of the alphabet as stars: a corner and its relations (paper, Figure 5)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mapmeld.matching.alphabet import Alphabet, AlphabetParameters
from mapmeld.report.canvas import Canvas
from mapmeld.report.marks import with_dots, with_labels, with_lines
from mapmeld.report.palette import FAINT, INK, PAIR_COLOURS, Colour


def common_relations(
    first: Alphabet, second: Alphabet, letters: tuple[int, int], T_1_2_theta: float, p: AlphabetParameters
) -> list[tuple[int, int]]:
    """Return the relations (of letter i in map 1, of letter z in map 2) that lie on one another.

    They are equally long within epsilon, and of equal bearing within nu once map 2 is turned by
    `T_1_2_theta` [rad]. Every relation is used at most once, the nearest bearings first.
    """
    i, z = letters
    mine, yours = np.flatnonzero(first.letter == i), np.flatnonzero(second.letter == z)
    length = np.abs(first.distance_px[mine][:, None] - second.distance_px[yours][None, :])
    turn = first.bearing[mine][:, None] - second.bearing[yours][None, :] - T_1_2_theta
    turn = np.abs((turn + math.pi) % math.tau - math.pi)
    slack = 1e-9
    fits = (length <= p.distance_tolerance_px + slack) & (turn <= math.radians(p.angle_tolerance_deg) + slack)
    pairs: list[tuple[int, int]] = []
    for position in np.argsort(np.where(fits, turn, np.inf), axis=None, kind="stable"):
        j, k = divmod(int(position), max(len(yours), 1))
        if not fits[j, k]:
            break
        if all(mine[j] != used and yours[k] != taken for used, taken in pairs):
            pairs.append((int(mine[j]), int(yours[k])))
    return pairs


def with_star(canvas: Canvas, alphabet: Alphabet, letter: int, common: Sequence[int]) -> Canvas:
    """Draw one letter on a picture of its map.

    Parameters
    ----------
    common
        Relations to draw thick, each in a colour of its own: the n-th in the n-th colour, so
        that it can be found again in the picture of the other map. All others are faint.
    """
    corners = alphabet.corners_px
    relations = np.flatnonzero(alphabet.letter == letter)
    others: NDArray[np.intp] = np.setdiff1d(relations, np.asarray(common, dtype=np.intp))
    for chosen, colours, thickness in (
        (others, [FAINT] * len(others), 1),
        (np.asarray(common, dtype=np.intp), _colours(len(common)), 3),
    ):
        start = np.broadcast_to(corners[letter], (len(chosen), 2))
        canvas = with_lines(canvas, start, corners[alphabet.other[chosen]], colours, thickness)
    canvas = with_dots(canvas, corners[alphabet.other[others]], FAINT, 3)
    for relation, colour in zip(common, _colours(len(common)), strict=True):
        canvas = with_dots(canvas, corners[alphabet.other[relation]], colour, 5)
    canvas = with_dots(canvas, corners[letter], INK, 7)
    named = [letter, *(int(alphabet.other[relation]) for relation in common)]
    return with_labels(canvas, corners[named], [str(n + 1) for n in named], INK)


def _colours(number: int) -> list[Colour]:
    return [PAIR_COLOURS[n % len(PAIR_COLOURS)] for n in range(number)]
