import math
import re

import numpy as np
import pytest
from drawing import drawn, office, seen_from
from numpy.typing import NDArray

from mapmeld.grid import FREE, UNKNOWN, OccupancyGrid
from mapmeld.matching import Verdict
from mapmeld.matching.alphabet import AlphabetParameters
from mapmeld.report import FIGURE_NAMES, Explanation, explain
from mapmeld.report.palette import BLUE, GREEN, RED
from mapmeld.se2 import Pose2

T_B_A = Pose2(3, -2, math.radians(40))


@pytest.fixture(scope="module")
def accepted() -> Explanation:
    return explain(office(), seen_from(office(), T_B_A), names=("one.yaml", "two.yaml"))


def names(explanation: Explanation) -> list[str]:
    return [figure.name for figure in explanation.figures]


def figure(explanation: Explanation, start: str) -> NDArray[np.uint8]:
    return next(f.picture for f in explanation.figures if f.name.startswith(start))


def test_every_step_has_its_picture(accepted: Explanation) -> None:
    assert accepted.result.verdict is Verdict.ACCEPTED
    assert names(accepted) == list(FIGURE_NAMES)
    for n, one in enumerate(accepted.figures, start=1):
        assert one.name.startswith(f"{n:02}_")
        assert one.picture.dtype == np.uint8
        assert one.picture.shape[2] == 3
        assert 600 <= max(one.picture.shape) <= 2500
        assert one.caption.endswith(".")


def test_captions_carry_the_figures(accepted: Explanation) -> None:
    captions = {one.name[:2]: one.caption for one in accepted.figures}
    assert f"{accepted.result.similarity:.3f}" in captions["12"]
    assert re.search(r"turn of -40\.\d degrees", captions["09"])
    assert str(accepted.result.T_a_b) in captions["14"]


def test_the_overlay_is_mostly_green_and_the_references_are_blue_and_red(accepted: Explanation) -> None:
    def count(start: str, colour: tuple[int, int, int]) -> int:
        return int((figure(accepted, start) == colour).all(axis=2).sum())

    assert count("15", GREEN) > 5 * (count("15", RED) + count("15", BLUE))
    # More than the swatches of the legend, which are about as large in all pictures.
    assert count("14", BLUE) > 600
    assert count("14", RED) > 600


def test_the_intersection_lies_within_the_union(accepted: Explanation) -> None:
    black = [(figure(accepted, n)[:600] == 0).all(axis=2) for n in ("12", "13")]
    assert black[0].sum() < black[1].sum()
    assert not (black[0] & ~black[1]).any()


def test_a_rejected_pair_is_explained_but_not_merged() -> None:
    parameters = AlphabetParameters(accept_similarity=1.0)
    explanation = explain(office(), seen_from(office(), T_B_A), parameters)
    assert explanation.result.verdict is Verdict.REJECTED
    assert names(explanation) == [n for n in FIGURE_NAMES if n != "14_merged.png"]
    assert "rejected, so not merged" in explanation.figures[-1].caption


@pytest.mark.parametrize(
    "b",
    [
        OccupancyGrid(np.full((40, 50), UNKNOWN, np.int8), 0.05),
        OccupancyGrid(np.full((40, 50), FREE, np.int8), 0.05),
        OccupancyGrid(np.zeros((0, 0), np.int8), 0.05),
        drawn("#", 0.05),
    ],
    ids=["unknown", "free", "empty", "one cell"],
)
def test_nothing_to_match_on(b: OccupancyGrid) -> None:
    explanation = explain(office(), b)
    assert explanation.result.T_a_b is None
    assert names(explanation)[:8] == list(FIGURE_NAMES[:8])
    assert "14_merged.png" not in names(explanation)
    assert "15_overlay.png" not in names(explanation)


def test_maps_of_different_resolution_are_shown_at_the_coarser_one() -> None:
    explanation = explain(office(0.05), seen_from(office(0.025), T_B_A))
    assert "0.05 m per cell" in explanation.figures[0].caption
    assert explanation.result.verdict is Verdict.ACCEPTED
