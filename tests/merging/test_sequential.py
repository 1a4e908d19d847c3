import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import yaml
from drawing import drawn, office, picture_of, seen_from

import mapmeld
from mapmeld.grid import OccupancyGrid
from mapmeld.io import MapFileError
from mapmeld.matching import MatchResult, Verdict
from mapmeld.matching.alphabet import AlphabetParameters
from mapmeld.merging import Joint, MergeError, UnknownFusionError, merge_aligned
from mapmeld.merging import merge as merge_maps
from mapmeld.se2 import Pose2

EXAMPLES = Path(__file__).parents[2] / "examples" / "maps"
QUARTER = math.pi / 2

merge = partial(merge_maps, strategy="sequential")


# ------------------------------------------------------------------ a matcher that says what a test wants
def spot(number: int) -> OccupancyGrid:
    """A map of one free cell; its percentage tells which map it is, also in a merged map."""
    return OccupancyGrid(np.array([[number]], np.int8), 1.0)


def spots(number: int) -> list[OccupancyGrid]:
    return [spot(i) for i in range(number)]


def maps_in(grid: OccupancyGrid) -> tuple[int, ...]:
    return tuple(int(value) for value in np.unique(grid.cells[grid.known]))


class Matcher:
    """Accepts what is in `fits`, by the maps that it is shown, and keeps what it was asked and said."""

    def __init__(self, fits: Mapping[tuple[tuple[int, ...], int], Pose2]) -> None:
        self.fits = fits
        self.calls: list[tuple[tuple[int, ...], int]] = []
        self.answers: list[MatchResult] = []
        self.settings: set[tuple[str, object]] = set()

    def __call__(self, a: OccupancyGrid, b: OccupancyGrid, method: str, parameters: object) -> MatchResult:
        asked = maps_in(a), maps_in(b)[0]
        self.calls.append(asked)
        self.settings.add((method, parameters))
        if asked in self.fits:
            answer = MatchResult(self.fits[asked], Verdict.ACCEPTED, "fits")
        else:
            # A guess that must not be believed, other each time.
            answer = MatchResult(Pose2(50.0 + len(self.calls)), Verdict.REJECTED, "does not fit")
        self.answers.append(answer)
        return answer


def use(monkeypatch: pytest.MonkeyPatch, matcher: object) -> None:
    monkeypatch.setattr("mapmeld.merging.sequential.match", matcher)


# ------------------------------------------------------------------ who is matched with whom
def test_each_map_is_matched_on_all_that_was_merged(monkeypatch: pytest.MonkeyPatch) -> None:
    T_0_1, T_0_2 = Pose2(4, 0, QUARTER), Pose2(0, 3, -QUARTER)
    matcher = Matcher({((0,), 1): T_0_1, ((0, 1), 2): T_0_2})
    use(monkeypatch, matcher)
    result = merge(spots(3))
    assert matcher.calls == [((0,), 1), ((0, 1), 2)]
    assert result.poses == (Pose2(), T_0_1, T_0_2)
    assert result.joints == (
        Joint((0,), 1, matcher.answers[0]),
        Joint((0, 1), 2, matcher.answers[1]),
    )
    assert result.complete
    assert result.refused == {}
    assert result.grid == merge_aligned(spots(3), [Pose2(), T_0_1, T_0_2])


def test_a_refused_map_is_tried_again_once_another_has_joined(monkeypatch: pytest.MonkeyPatch) -> None:
    T_0_1, T_0_2, T_0_3 = Pose2(2), Pose2(4), Pose2(6)
    matcher = Matcher({((0,), 2): T_0_2, ((0, 2), 3): T_0_3, ((0, 2, 3), 1): T_0_1})
    use(monkeypatch, matcher)
    result = merge(spots(4))
    assert result.poses == (Pose2(), T_0_1, T_0_2, T_0_3)
    # In the order in which they were joined, those that are waiting first.
    assert [(j.reference, j.index) for j in result.joints] == [((0,), 2), ((0, 2), 3), ((0, 2, 3), 1)]
    assert matcher.calls == [((0,), 1), ((0,), 2), ((0, 2), 3), ((0, 2, 3), 1)]
    assert result.refused == {}


def test_a_map_that_does_not_fit_on_all_is_tried_on_each(monkeypatch: pytest.MonkeyPatch) -> None:
    T_0_1, T_1_2 = Pose2(4, 0, QUARTER), Pose2(3, 1, QUARTER)
    matcher = Matcher({((0,), 1): T_0_1, ((1,), 2): T_1_2})
    use(monkeypatch, matcher)
    result = merge(spots(3))
    assert matcher.calls == [((0,), 1), ((0, 1), 2), ((0,), 2), ((1,), 2)]
    assert result.joints[1] == Joint((1,), 2, matcher.answers[3])
    # The joint is in the frame of map 1; the pose is in that of map 0.
    assert result.joints[1].result.T_a_b == T_1_2
    assert result.poses == (Pose2(), T_0_1, T_0_1 @ T_1_2)
    assert result.grid == merge_aligned(spots(3), [Pose2(), T_0_1, T_0_1 @ T_1_2])
    assert maps_in(result.grid) == (0, 1, 2)


def test_what_is_ambiguous_on_all_is_not_settled_by_one_that_shows_less(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def of_a_repeating_place(a: OccupancyGrid, b: OccupancyGrid, *_: object) -> MatchResult:
        on_all = maps_in(a) == (0, 1) and maps_in(b) == (2,)
        first_try = maps_in(a) == (0,) and maps_in(b) == (1,)
        verdict = Verdict.AMBIGUOUS if on_all else Verdict.ACCEPTED
        return MatchResult(Pose2(5.0 if first_try else 9.0), verdict, "")

    use(monkeypatch, of_a_repeating_place)
    result = merge(spots(3))
    assert result.components == ((0, 1), (2,))
    assert result.refused[2].verdict is Verdict.AMBIGUOUS


@pytest.mark.parametrize("verdict", [Verdict.REJECTED, Verdict.AMBIGUOUS])
def test_only_what_is_accepted_is_merged(verdict: Verdict, monkeypatch: pytest.MonkeyPatch) -> None:
    answer = MatchResult(Pose2(2), verdict, "a good guess, perhaps", similarity=0.9)
    use(monkeypatch, lambda *_: answer)
    maps = [spot(0), spot(1)]
    result = merge(maps)
    assert result.poses == result.starts == (Pose2(), None)
    assert result.components == ((0,), (1,))
    assert result.joints == ()
    assert result.refused == {1: answer}
    assert result.grid == maps[0]
    assert not result.complete


def test_refused_is_the_last_match_with_all_around_map_0(monkeypatch: pytest.MonkeyPatch) -> None:
    matcher = Matcher({((0,), 2): Pose2(2)})
    use(monkeypatch, matcher)
    result = merge(spots(3))
    said = dict(zip(matcher.calls, matcher.answers, strict=True))
    assert ((0,), 1) in said
    assert ((2,), 1) in said
    assert result.refused == {1: said[(0, 2), 1]}


def test_what_is_left_makes_components_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    T_1_5, T_1_3 = Pose2(0, 2), Pose2(3, 3, QUARTER)
    matcher = Matcher(
        {
            ((0,), 4): Pose2(2), ((0, 4), 2): Pose2(4),
            ((1,), 5): T_1_5, ((1, 5), 3): T_1_3,
        }
    )  # fmt: skip
    use(monkeypatch, matcher)
    result = merge(spots(7))
    # Each with its indices in order, whatever the order in which they were joined, map 0's first.
    assert result.components == ((0, 2, 4), (1, 3, 5), (6,))
    assert [(j.reference, j.index, j.result.T_a_b) for j in result.joints] == [
        ((0,), 4, Pose2(2)),
        ((0, 4), 2, Pose2(4)),
        ((1,), 5, T_1_5),
        ((1, 5), 3, T_1_3),
    ]
    # What fits one another, but not map 0, has no pose there and is not drawn.
    assert result.poses == (Pose2(), None, Pose2(4), None, Pose2(2), None, None)
    assert set(result.refused) == {1, 3, 5, 6}
    assert maps_in(result.grid) == (0, 2, 4)


def test_a_component_starts_from_the_first_map_that_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    # Map 2 joins while map 1 has been refused and waits behind map 3.
    matcher = Matcher({((0,), 2): Pose2(2), ((1,), 3): Pose2(2), ((3,), 1): Pose2(-2)})
    use(monkeypatch, matcher)
    result = merge(spots(4))
    assert [(j.reference, j.index) for j in result.joints] == [((0,), 2), ((1,), 3)]
    use(monkeypatch, Matcher({((0,), 2): Pose2(2)}))
    assert merge(spots(4)).components == ((0, 2), (1,), (3,))


def test_method_and_parameters_reach_the_matcher(monkeypatch: pytest.MonkeyPatch) -> None:
    matcher = Matcher({((0,), 1): Pose2(2)})
    use(monkeypatch, matcher)
    parameters = AlphabetParameters(corners=7)
    merge(spots(3), method="its name", parameters=parameters)
    assert ((1,), 2) in matcher.calls  # also where a map is tried on each
    assert matcher.settings == {("its name", parameters)}


# ------------------------------------------------------------------ start poses
def test_starts_are_taken_into_the_first_maps_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    T_0_1 = Pose2(4, 1, QUARTER)
    use(monkeypatch, Matcher({((0,), 1): T_0_1}))
    starts = [Pose2(1, 2, 0.5), Pose2(3, 0, 1.0), Pose2(5, 5)]
    found = merge(spots(3), starts=starts).starts
    assert found[0] == starts[0]
    # Three metres along map 1's x axis, which points up in map 0.
    assert found[1] is not None
    assert found[1].distance_to(Pose2(4, 4, QUARTER + 1.0)) == pytest.approx((0, 0), abs=1e-9)
    assert found[2] is None
    # A robot starts at the zero of its own map where nothing else is said.
    assert merge(spots(3)).starts == (Pose2(), T_0_1, None)


@pytest.mark.parametrize("number", [0, 1, 3])
def test_as_many_starts_as_maps(number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    use(monkeypatch, lambda *_: pytest.fail("matched before it looked"))
    with pytest.raises(MergeError, match=f"2 maps need 2 start poses, not {number}"):
        merge(spots(2), starts=[Pose2()] * number)


# ------------------------------------------------------------------ fusion
def test_maps_are_matched_on_the_colour_rule_and_fused_as_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[str] = []

    def matcher(a: OccupancyGrid, *_: object) -> MatchResult:
        shown.append(picture_of(a))
        return MatchResult(Pose2(), Verdict.ACCEPTED, "fits")

    use(monkeypatch, matcher)
    maps = [drawn("#.."), drawn(".#."), drawn("..#")]
    assert picture_of(merge(maps, fusion="newest").grid) == "..#"
    assert picture_of(merge(maps, fusion="vote").grid) == "..."
    assert merge(maps, fusion="average").grid.cells.tolist() == [[33, 33, 33]]
    assert picture_of(merge(maps).grid) == "###"
    assert shown == ["#..", "##."] * 4


def test_newest_goes_by_the_order_of_the_maps_not_of_joining(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []

    def matcher(_: OccupancyGrid, b: OccupancyGrid, *__: object) -> MatchResult:
        asked.append(int(b.cells[0, 0]))
        return MatchResult(Pose2(), Verdict.REJECTED if asked == [1] else Verdict.ACCEPTED, "")

    use(monkeypatch, matcher)
    result = merge(spots(3), fusion="newest")
    assert [joint.index for joint in result.joints] == [2, 1]
    assert maps_in(result.grid) == (2,)


def test_an_unknown_fusion_is_found_out_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    use(monkeypatch, lambda *_: pytest.fail("matched before it looked"))
    with pytest.raises(UnknownFusionError, match="'blend'"):
        merge(spots(2), fusion="blend")
    with pytest.raises(UnknownFusionError, match="'blend'"):
        merge([tmp_path / "nowhere.yaml"] * 2, fusion="blend")


def test_maps_that_lie_too_far_apart_are_an_error_not_a_full_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    use(monkeypatch, Matcher({((0,), 1): Pose2(1e9, 1e9)}))
    with pytest.raises(MergeError, match="check the poses"):
        merge(spots(2))


# ------------------------------------------------------------------ what goes in and out
@pytest.mark.parametrize("one", ["a.yaml", Path("a.yaml")])
def test_one_path_is_not_a_list_of_maps(one: str | Path) -> None:
    with pytest.raises(MergeError, match=r"'a.yaml' is one map"):
        merge(one)  # type: ignore[arg-type]


def test_no_map_is_an_error_and_one_is_itself() -> None:
    with pytest.raises(MergeError, match="no map"):
        merge([])
    alone = merge([office(0.2)])
    assert alone.complete
    assert alone.grid == office(0.2)
    assert (alone.poses, alone.components, alone.refused) == ((Pose2(),), ((0,),), {})


def test_an_incomplete_merge_is_not_saved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    use(monkeypatch, Matcher({((0,), 2): Pose2(2), ((1,), 4): Pose2(2)}))
    result = merge(spots(5))
    assert result.components == ((0, 2), (1, 4), (3,))
    with pytest.raises(MergeError, match=r"3 of 5 maps .*indices 1, 4, 3\)") as refused:
        result.save(tmp_path / "m.yaml", force=True)
    assert "\n" not in str(refused.value)
    assert list(tmp_path.iterdir()) == []


def test_a_complete_merge_is_saved_and_replaces_nothing_unasked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    use(monkeypatch, Matcher({((0,), 1): Pose2(1)}))
    result = merge(spots(2))
    written = result.save(tmp_path / "m.yaml")
    assert set(written) == {tmp_path / "m.yaml", tmp_path / "m.pgm"} == set(tmp_path.iterdir())
    assert picture_of(mapmeld.load(tmp_path / "m.yaml")) == ".."
    with pytest.raises(MapFileError, match=r"m\.\w+: exists already"):
        result.save(tmp_path / "m.yaml")
    assert result.save(tmp_path / "m.yaml", force=True) == written


# ------------------------------------------------------------------ with the paper's matcher
T_1_0, T_2_0 = Pose2(2.0, -7.0, 0.7), Pose2(-3.0, 1.0, -2.0)  # from the office's frame into those of the maps


def middles_apart(found: Pose2 | None, T_0_i: Pose2) -> float:
    """How far [m] two poses are apart at the middle of the office."""
    assert found is not None
    return float(np.hypot(*(found.apply(T_0_i.inverse().apply((8, 6))) - (8, 6))))


def test_maps_of_one_place_are_laid_on_one_another_and_another_place_is_left_out() -> None:
    a = office()
    maps = [a, seen_from(a, T_1_0), mapmeld.load(EXAMPLES / "other_building.yaml"), seen_from(a, T_2_0)]
    result = merge(maps, method="alphabet")
    assert result.components == ((0, 1, 3), (2,))
    assert result.poses[0] == Pose2()
    assert middles_apart(result.poses[1], T_1_0.inverse()) < 0.1
    assert middles_apart(result.poses[3], T_2_0.inverse()) < 0.1
    assert result.starts == result.poses
    assert result.poses[2] is None
    # The matcher had a guess for the other place too.
    assert result.refused[2].T_a_b is not None
    assert result.refused[2].verdict is Verdict.REJECTED
    # On the lattice of the first map, and nothing is drawn that is not of the office.
    shift = result.grid.metres_to_lattice((0.0, 0.0))
    np.testing.assert_allclose(shift, np.rint(shift), atol=1e-6)
    assert result.grid.resolution == 0.05
    assert result.grid.known_area == pytest.approx(16 * 12, rel=0.05)


TRUTH = yaml.safe_load((EXAMPLES / "truth.yaml").read_text())["transforms"]
T_1 = {1: Pose2(), 2: Pose2(*TRUTH["T_1_2"]), 3: Pose2(*TRUTH["T_1_3"])}


@pytest.mark.parametrize("order", [(1, 2, 3), (1, 3, 2), (2, 1, 3), (2, 3, 1), (3, 1, 2), (3, 2, 1)])
def test_the_example_maps_are_joined_in_every_order(order: tuple[int, int, int]) -> None:
    result = merge([EXAMPLES / f"robot_{i}.yaml" for i in order], method="alphabet")
    assert result.complete
    for i, T_first_i in zip(order, result.poses, strict=True):
        assert T_first_i is not None
        metres, radians = T_first_i.distance_to(T_1[order[0]].inverse() @ T_1[i])
        assert metres < 0.3  # as far as SLAM bent the maps
        assert radians < math.radians(1.5)
