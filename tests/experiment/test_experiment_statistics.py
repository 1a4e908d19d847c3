import math
from dataclasses import replace

import pytest
from test_experiment_folder import JOIN, MATCHING

from mapmeld.experiment import Results
from mapmeld.experiment.rows import ElsewhereRow, MatchingRow, NavigabilityRow
from mapmeld.experiment.statistics import (
    Column,
    Successes,
    Ways,
    accepted_elsewhere,
    joined,
    kind_of_cause,
    method_label,
    stated_probabilities,
    table_1,
    ways_by_kind,
)

GOOD = replace(MATCHING, right=True, accepted=True, T_1_2=(1.0, 0.0, 0.0), accuracy=0.9, cause="")
WAY = NavigabilityRow(
    environment=1,
    members=(1,),
    method="",
    problem="",
    pairs=10,
    reachable_map=8,
    reachable_truth=10,
    false_passages=1,
    false_blocks=2,
    length_ratios=(1.0, 1.25, 1.1),
    seconds=1.0,
)


def results(**parts: object) -> Results:
    nothing: dict[str, object] = {
        "settings": {},
        "methods": ("alphabet", "correlative"),
        "environments": (),
        "mappings": (),
        "matchings": (),
        "joins": (),
        "elsewhere": (),
        "ways": (),
        "wall_seconds": {},
    }
    return Results(**(nothing | parts))  # type: ignore[arg-type]


def test_a_column_of_table_1_by_hand() -> None:
    # Mean (0.90 + 0.92 + 0.97) / 3 = 0.93; deviations -0.03, -0.01, 0.04: sqrt(0.0026 / 2).
    column = Column.of([0.97, 0.90, 0.92])
    assert column.count == 3
    assert column.mean == pytest.approx(0.93)
    assert column.median == 0.92
    assert column.deviation == pytest.approx(math.sqrt(0.0013))


def test_too_few_values_have_no_figures() -> None:
    assert Column.of([]) == Column(0, None, None, None)
    assert Column.of([0.9]) == Column(1, 0.9, 0.9, None)


def test_table_1_takes_successes_alone() -> None:
    rows = (GOOD, replace(GOOD, accuracy=0.8), MATCHING, replace(GOOD, method="correlative", accuracy=0.7))
    table = table_1(results(matchings=rows))
    assert table[""].count == 0
    assert table["alphabet"].count == 2
    assert table["alphabet"].mean == pytest.approx(0.85)
    assert table["correlative"] == Column(1, 0.7, 0.7, None)


def test_successes_are_counted_by_truth_and_by_word() -> None:
    rows = [GOOD, replace(GOOD, accepted=False), MATCHING, replace(MATCHING, accepted=True)]
    assert Successes.of(rows) == Successes(total=4, right=2, accepted_right=1, accepted_wrong=1)


def test_joined_counts_those_that_reached_a_size_or_more() -> None:
    rows = (JOIN, replace(JOIN, members=(1, 2)), replace(JOIN, members=(1, 2, 3, 4, 5)))
    assert joined(results(joins=rows), "alphabet") == {2: 3, 3: 2, 4: 1, 5: 1}
    assert joined(results(joins=rows), "correlative") == {}


def test_ways_add_up_by_kind_of_map() -> None:
    rows = (
        WAY,
        replace(WAY, length_ratios=(1.5,)),
        replace(WAY, method="alphabet", members=(1, 2), false_passages=4),
        replace(WAY, method="alphabet", members=(1, 2, 3), length_ratios=()),
    )
    found = ways_by_kind(results(ways=rows))
    assert found == {
        "single mappings": Ways(2, 20, 16, 20, 2, 4, 1.175),
        "paper's method, two merged": Ways(1, 10, 8, 10, 4, 2, 1.1),
        "paper's method, three to all merged": Ways(1, 10, 8, 10, 1, 2, None),
    }


def test_probabilities_of_different_environments_are_never_right() -> None:
    other = ElsewhereRow(
        environment_1=1,
        mapping_1=1,
        environment_2=2,
        mapping_2=1,
        method="correlative",
        accepted=True,
        probability=0.25,
        similarity=0.1,
        seconds=1.0,
    )
    rows: tuple[MatchingRow, ...] = (replace(GOOD, method="correlative", probability=1.0), GOOD)
    found = results(matchings=rows, elsewhere=(other,))
    stated = stated_probabilities(found, "correlative")
    assert (stated.probability, stated.right) == ((1.0, 0.25), (True, False))
    assert stated.brier == pytest.approx(0.25**2 / 2)
    assert stated_probabilities(found, "alphabet").calibration_error is None
    assert accepted_elsewhere(found, "correlative") == (1, 1)
    assert accepted_elsewhere(found, "alphabet") == (0, 0)


def test_words() -> None:
    assert kind_of_cause("misled: a wrong transform") == "misled"
    assert kind_of_cause("no common area") == "no common area"
    names = [method_label(m) for m in ("alphabet", "correlative", "feature_orb")]
    assert names == ["paper's method", "default method", "feature_orb"]
