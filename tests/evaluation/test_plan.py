from pathlib import Path

import pytest
from drawing import office
from tiny_dataset import T_1_2, pair, tiny_pairs, write_dataset, write_pairs

from mapmeld.evaluation import DatasetError, PlanError, Tolerance, Trial, plan_trials, read_dataset
from mapmeld.grid import FREE, OccupancyGrid
from mapmeld.io import MapFileError, save
from mapmeld.matching import UnknownMethodError
from mapmeld.matching.alphabet import AlphabetParameters
from mapmeld.se2 import Pose2


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_dataset(tmp_path / "tiny")


def plan(folder: Path, **options: object) -> tuple[Trial, ...]:
    return plan_trials([read_dataset(folder)], ["alphabet"], **options)  # type: ignore[arg-type]


def test_every_pair_once_in_the_order_of_the_list(folder: Path) -> None:
    trials = plan(folder)
    assert [t.pair.id for t in trials] == ["one-two", "one-three", "one-other"]
    assert {(t.dataset, t.method, t.turn_seed, t.swapped) for t in trials} == {
        ("tiny", "alphabet", None, False)
    }
    assert len({t.key for t in trials}) == 3


def test_what_the_list_leaves_out_is_computed_from_the_maps(folder: Path) -> None:
    stated, computed, different = (t.pair for t in plan(folder))
    assert stated.centroid == (8.0, 6.0)
    assert computed.centroid == pytest.approx((8.0, 6.0), abs=0.05)
    assert computed.overlap == pytest.approx(1.0, abs=0.02)
    assert (different.centroid, different.overlap) == (None, 0.0)


def test_turns_depend_on_nothing_but_seed_data_set_pair_and_count(folder: Path) -> None:
    seeds = [t.turn_seed for t in plan(folder, turn=3)]
    assert len(set(seeds)) == 9
    assert [t.turn_seed for t in plan(folder, turn=2)] == [s for i, s in enumerate(seeds) if i % 3 < 2]
    assert not set(seeds) & {t.turn_seed for t in plan(folder, turn=3, seed=1)}
    by_pair = {(t.pair.id, t.turn_seed) for t in plan(folder, turn=3)}
    assert {(t.pair.id, t.turn_seed) for t in plan(folder, turn=3, limit=2)} < by_pair


def test_the_limit_draws_by_the_seed_and_keeps_the_order(folder: Path) -> None:
    drawn = {seed: [t.pair.id for t in plan(folder, limit=2, seed=seed)] for seed in range(20)}
    order = [t.pair.id for t in plan(folder)]
    assert all(ids == sorted(ids, key=order.index) and len(ids) == 2 for ids in drawn.values())
    assert len({tuple(ids) for ids in drawn.values()}) == 3
    assert len(plan(folder, limit=99)) == 3


def test_the_strongest_tolerance_is_the_asked_then_the_pairs_then_the_sets(folder: Path) -> None:
    write_pairs(folder, [pair("own", "one", "two", T_1_2, tolerance=[2, 20]), *tiny_pairs()[:1]])
    write_pairs(folder, {"tolerance": [1, 10]}, "dataset.json")
    assert [t.tolerance for t in plan(folder)] == [Tolerance.of(2, 20), Tolerance.of(1, 10)]
    asked = {"tiny": Tolerance.of(3, 30)}
    assert [t.tolerance for t in plan(folder, tolerances=asked)] == [Tolerance.of(3, 30)] * 2


def test_settings_are_part_of_what_is_tried(folder: Path) -> None:
    default = plan(folder)[0]
    other = plan(folder, parameters={"alphabet": AlphabetParameters(corners=7)})[0]
    assert '"corners": 7' in other.parameters
    assert default.key != other.key


@pytest.mark.parametrize("change", ["map", "truth"])
def test_another_map_or_another_truth_is_another_trial(folder: Path, change: str) -> None:
    before = plan(folder)
    if change == "map":
        save(OccupancyGrid(office(0.1).cells * 0 + FREE, 0.1), folder / "maps" / "two.yaml", force=True)
    else:
        write_pairs(folder, [pair("one-two", "one", "two", T_1_2, centroid=[8, 6.5]), *tiny_pairs()[1:]])
    after = plan(folder)
    assert before[0].key != after[0].key
    assert [t.key for t in before[1:]] == [t.key for t in after[1:]]


def test_each_pair_that_was_read_is_reported(folder: Path) -> None:
    calls: list[None] = []
    plan(folder, on_pair=lambda: calls.append(None))
    assert len(calls) == 3


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"turn": -1}, "cannot be negative"),
        ({"limit": 0}, "at least one pair"),
        ({"tolerances": {"house": Tolerance()}}, "a tolerance for house, but no data set"),
    ],
)
def test_requests_that_make_no_sense(folder: Path, options: dict[str, object], said: str) -> None:
    with pytest.raises(PlanError, match=said):
        plan(folder, **options)


def test_names_must_tell_data_sets_and_methods_apart(folder: Path) -> None:
    dataset = read_dataset(folder)
    with pytest.raises(PlanError, match=r"two times the same data set: tiny.*dataset\.json"):
        plan_trials([dataset, dataset], ["alphabet"])
    with pytest.raises(PlanError, match="two times the same method: alphabet"):
        plan_trials([dataset], ["alphabet", "alphabet"])
    with pytest.raises(PlanError, match="at least one method"):
        plan_trials([dataset], [])


@pytest.mark.parametrize(
    "options", [{"methods": ["fortune"]}, {"methods": ["alphabet"], "time_against": "fortune"}]
)
def test_unknown_methods_are_known_before_the_run(folder: Path, options: dict[str, object]) -> None:
    with pytest.raises(UnknownMethodError, match="fortune"):
        plan_trials([read_dataset(folder)], **options)  # type: ignore[arg-type]


def test_a_missing_map_is_known_before_the_run(folder: Path) -> None:
    (folder / "maps" / "three.yaml").unlink()
    with pytest.raises(MapFileError, match=r"three\.yaml"):
        plan(folder)


def test_a_truth_under_which_the_maps_do_not_meet(folder: Path) -> None:
    write_pairs(folder, [pair("far", "one", "two", Pose2(1000, 0, 0))])
    with pytest.raises(DatasetError, match="pair far: the maps do not overlap"):
        plan(folder)
