import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.ndimage import binary_fill_holes, label

from mapmeld.changes.outlines import outline


def mask_of(picture: str) -> np.ndarray:
    return np.array([[c == "#" for c in line] for line in picture.strip("\n").split("\n")][::-1])


def area_of(ring: np.ndarray) -> float:
    x, y = ring.T
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum()) / 2


def test_one_cell() -> None:
    assert outline(np.array([[True]])).tolist() == [[0, 0], [1, 0], [1, 1], [0, 1]]


def test_corners_only_where_the_border_turns() -> None:
    ring = outline(mask_of("#..\n###"))
    assert ring.tolist() == [[0, 0], [3, 0], [3, 1], [1, 1], [1, 2], [0, 2]]


@pytest.mark.parametrize(
    "picture",
    [
        "###\n#.#\n###",  # a hole
        "###\n#.#\n.##",  # shut by a corner only
        "####\n#..#\n#.##\n###.",
    ],
)
def test_holes_are_filled(picture: str) -> None:
    mask = mask_of(picture)
    assert area_of(outline(mask)) == binary_fill_holes(mask).sum()


@given(arrays(np.bool_, st.tuples(st.integers(1, 9), st.integers(1, 9))))
def test_the_outline_of_any_patch_is_simple_and_exact(cells: np.ndarray) -> None:
    parts, count = label(cells)
    for number in range(1, count + 1):
        mask = parts == number
        ring = outline(mask)
        steps = np.roll(ring, -1, axis=0) - ring
        assert ((steps != 0).sum(axis=1) == 1).all()  # along the edges of cells
        before = np.roll(steps, 1, axis=0)
        turns = before[:, 0] * steps[:, 1] - before[:, 1] * steps[:, 0]
        assert (turns != 0).all()  # no needless corner
        # Every lattice corner on the way is passed once: it neither crosses nor touches itself.
        passed = [
            tuple(start + k * np.sign(step))
            for start, step in zip(ring, steps, strict=True)
            for k in range(np.abs(step).sum())
        ]
        assert len(set(passed)) == len(passed)
        assert area_of(ring) == np.asarray(binary_fill_holes(mask)).sum()  # counter-clockwise: positive
