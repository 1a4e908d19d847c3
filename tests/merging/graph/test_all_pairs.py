import math
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawing import office, seen_from

from mapmeld.extras import MissingExtraError
from mapmeld.grid import OccupancyGrid
from mapmeld.matching import Alternative, MatchResult, Verdict, match
from mapmeld.matching.alphabet import AlphabetParameters
from mapmeld.merging.graph import match_all_pairs
from mapmeld.merging.graph.all_pairs import PAIR_STORE, PairRow
from mapmeld.parquet_rows import StoreError
from mapmeld.se2 import Pose2

OFFICE = office(0.2)
MAPS = [OFFICE, seen_from(OFFICE, Pose2(3, -2, 0.6)), seen_from(OFFICE, Pose2(-1, 4, -1.3))]


def timeless(found: tuple[tuple[int, int, MatchResult], ...]) -> list[Any]:
    rows = [(i, j, PairRow.of(("", "", "", "", ""), result)) for i, j, result in found]
    return [(i, j, replace(row, seconds=0.0)) for i, j, row in rows]


class Counting:
    def __init__(self, stop_after: int | None = None) -> None:
        self.calls: list[tuple[OccupancyGrid, OccupancyGrid, str, object]] = []
        self.stop_after = stop_after

    def __call__(self, a: OccupancyGrid, b: OccupancyGrid, method: str, parameters: object) -> MatchResult:
        if len(self.calls) == self.stop_after:
            raise KeyboardInterrupt
        self.calls.append((a, b, method, parameters))
        return MatchResult(Pose2(len(self.calls)), Verdict.ACCEPTED, "", 0.9)


@pytest.fixture
def counting(monkeypatch: pytest.MonkeyPatch) -> Counting:
    matcher = Counting()
    monkeypatch.setattr("mapmeld.merging.graph.all_pairs.match", matcher)
    return matcher


def test_every_map_is_matched_with_every_later_one(counting: Counting) -> None:
    found = match_all_pairs(MAPS)
    assert [(i, j) for i, j, _ in found] == [(0, 1), (0, 2), (1, 2)]
    assert [(MAPS.index(a), MAPS.index(b)) for a, b, *_ in counting.calls] == [(0, 1), (0, 2), (1, 2)]
    assert match_all_pairs(MAPS[:1]) == match_all_pairs([]) == ()


def test_method_and_settings_reach_the_matcher(counting: Counting) -> None:
    parameters = AlphabetParameters(corners=7)
    match_all_pairs(MAPS, method="alphabet", parameters=parameters)
    assert {(method, chosen) for *_, method, chosen in counting.calls} == {("alphabet", parameters)}


def test_the_answers_are_those_of_match() -> None:
    ((_, _, found),) = match_all_pairs(MAPS[:2])
    assert found.T_a_b == match(MAPS[0], MAPS[1]).T_a_b


def test_workers_change_nothing_but_seconds() -> None:
    ticks: list[int] = []
    here = match_all_pairs(MAPS)
    there = match_all_pairs(MAPS, workers=2, on_pair=lambda: ticks.append(1))
    assert timeless(here) == timeless(there)
    assert len(ticks) == 3


# ------------------------------------------------------------------ the store
def test_what_is_stored_is_not_matched_again(tmp_path: Path, counting: Counting) -> None:
    ticks: list[int] = []
    first = match_all_pairs(MAPS, store=tmp_path / "s")
    again = match_all_pairs(MAPS, store=tmp_path / "s", on_pair=lambda: ticks.append(1))
    assert len(counting.calls) == 3
    assert timeless(first) == timeless(again)
    assert len(ticks) == 3  # progress counts them all the same


def test_maps_that_come_later_are_matched_with_those_before(tmp_path: Path, counting: Counting) -> None:
    match_all_pairs(MAPS[:2], store=tmp_path)
    match_all_pairs(MAPS, store=tmp_path)
    assert len(counting.calls) == 3


def test_other_maps_settings_and_code_are_matched_anew(
    tmp_path: Path, counting: Counting, monkeypatch: pytest.MonkeyPatch
) -> None:
    match_all_pairs(MAPS[:2], store=tmp_path)
    match_all_pairs([MAPS[0], MAPS[1].moved(Pose2(1))], store=tmp_path)
    match_all_pairs(MAPS[:2], store=tmp_path, method="alphabet")
    match_all_pairs(MAPS[:2], store=tmp_path, method="alphabet", parameters=AlphabetParameters(corners=7))
    monkeypatch.setattr("mapmeld.merging.graph.all_pairs.code_version", lambda: "newer")
    match_all_pairs(MAPS[:2], store=tmp_path)
    assert len(counting.calls) == 5
    assert len(PAIR_STORE.read(tmp_path)) == 5


def test_an_interrupted_run_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stopping = Counting(stop_after=2)
    monkeypatch.setattr("mapmeld.merging.graph.all_pairs.match", stopping)
    with pytest.raises(KeyboardInterrupt):
        match_all_pairs(MAPS, store=tmp_path)
    assert len(PAIR_STORE.read(tmp_path)) == 2
    stopping.stop_after = None
    match_all_pairs(MAPS, store=tmp_path)
    assert len(stopping.calls) == 3


def test_results_are_on_disk_while_the_work_goes_on(
    tmp_path: Path, counting: Counting, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mapmeld.merging.graph.all_pairs.BATCH_SECONDS", 0.0)
    seen: list[int] = []
    match_all_pairs(MAPS, store=tmp_path, on_pair=lambda: seen.append(len(PAIR_STORE.read(tmp_path))))
    assert seen == [1, 2, 3]


def test_a_damaged_store_is_named(tmp_path: Path, counting: Counting) -> None:
    match_all_pairs(MAPS, store=tmp_path)
    part = min(tmp_path.iterdir())
    part.write_bytes(b"nothing of the kind")
    with pytest.raises(StoreError, match=part.name):
        match_all_pairs(MAPS, store=tmp_path)


def test_a_store_that_cannot_be_is_found_out_before_the_work(
    tmp_path: Path, counting: Counting, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("mine")
    with pytest.raises(StoreError, match="file: cannot be made"):
        match_all_pairs(MAPS, store=tmp_path / "file")
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    with pytest.raises(MissingExtraError, match=r'pip install "mapmeld\[store\]"'):
        match_all_pairs(MAPS, store=tmp_path / "s")
    assert counting.calls == []


@pytest.mark.parametrize(
    "result",
    [
        MatchResult(None, Verdict.REJECTED, "nothing to match on"),
        MatchResult(
            Pose2(1, 2, 3),
            Verdict.AMBIGUOUS,
            "two",
            0.5,
            0.25,
            0.75,
            np.arange(9.0).reshape(3, 3),
            (Alternative(Pose2(4, 5, 6), 0.1, 0.4), Alternative(Pose2(7, 8, 9), 0.2)),
            "correlative",
            1.5,
        ),
    ],
)
def test_a_row_gives_back_the_result(tmp_path: Path, result: MatchResult) -> None:
    key = ("a", "b", result.method, "{}", "1")
    PAIR_STORE.add(tmp_path, [PairRow.of(key, result)])
    (row,) = PAIR_STORE.read(tmp_path)
    assert row.key == key
    back = row.result()
    assert replace(back, covariance=None) == replace(result, covariance=None)
    assert (back.covariance is None) == (result.covariance is None)
    if back.covariance is not None and result.covariance is not None:
        np.testing.assert_array_equal(back.covariance, result.covariance)
    assert not any(p is not None and math.isnan(p) for p in (a.probability for a in back.alternatives))
