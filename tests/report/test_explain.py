import math
import re

import numpy as np
import pytest
from drawing import drawn, office, seen_from
from numpy.typing import NDArray

from mapmeld.grid import FREE, UNKNOWN, OccupancyGrid
from mapmeld.matching import Verdict
from mapmeld.matching.alphabet import AlphabetParameters
from mapmeld.report import FIGURE_NAMES, POSSIBLE_NAMES, Explanation, explain
from mapmeld.report.palette import BLUE, GREEN, RED
from mapmeld.se2 import Pose2

T_B_A = Pose2(3, -2, math.radians(40))


@pytest.fixture(scope="module")
def accepted() -> Explanation:
    return explain(office(), seen_from(office(), T_B_A), names=("one.yaml", "two.yaml"))


def names(explanation: Explanation) -> list[str]:
    return [figure.name for figure in explanation.figures]


def check_numbers(explanation: Explanation) -> None:
    """One after the other, and no name that a later run with other maps would not clean away."""
    for n, name in enumerate(names(explanation), start=1):
        assert name.startswith(f"{n:02}_")
        assert name in POSSIBLE_NAMES


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
    assert re.search(r"turn of the pixels by -40\.\d degrees, in direction", captions["09"])
    assert str(accepted.result.T_a_b) in captions["14"]


def test_the_overlay_is_mostly_green_and_the_references_are_red_and_blue(accepted: Explanation) -> None:
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
    assert names(explanation) == [*FIGURE_NAMES[:13], "14_overlay.png"]
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
    check_numbers(explanation)
    assert not any("merged" in name or "overlay" in name for name in names(explanation))


def test_no_candidate_leaves_no_gap_in_the_numbers() -> None:
    explanation = explain(office(), seen_from(office(), T_B_A), AlphabetParameters(relation_min_px=1e6))
    check_numbers(explanation)
    assert names(explanation)[8:] == ["09_gamma.png"]


def test_lattices_with_a_yaw_have_both_turns_named() -> None:
    a = OccupancyGrid(office().cells, 0.05, Pose2(-3, 2, math.radians(10)))
    b = seen_from(office(), T_B_A)
    b = OccupancyGrid(b.cells, 0.05, Pose2(1, 1, math.radians(-100)))
    explanation = explain(a, b)
    T_a_b = explanation.result.T_a_b
    assert T_a_b is not None
    captions = {one.name[3:]: one.caption for one in explanation.figures}
    for name in ("first_letters.png", "second_letters.png"):
        found = re.search(
            r"turn of the pixels by (\S+) degrees \(theta (\S+) degrees between the frames, in which "
            r"the pixels of a are turned by 10\.0 and those of b by -100\.0 degrees\)",
            captions[name],
        )
        assert found is not None, captions[name]
        assert float(found[1]) == pytest.approx(-40, abs=1)
        assert float(found[2]) == pytest.approx(math.degrees(T_a_b.theta), abs=1)
    for name in ("merged.png", "overlay.png"):
        assert captions[name].endswith("turned by 10.0 degrees in the map's frame.")


def test_maps_of_different_resolution_are_shown_at_the_coarser_one() -> None:
    explanation = explain(office(0.05), seen_from(office(0.025), T_B_A))
    assert "0.05 m per cell" in explanation.figures[0].caption
    assert explanation.result.verdict is Verdict.ACCEPTED
