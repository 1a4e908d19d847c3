from pathlib import Path

import pytest
from drawing import drawn, hall, office, seen_from
from index_maps import T_B_A, index_of, write_buildings

from mapmeld.index import candidates_for, find
from mapmeld.matching import Verdict
from mapmeld.matching.match import UnknownMethodError
from mapmeld.se2 import Pose2


def test_the_maps_of_the_place_come_first_with_where_it_lies(tmp_path: Path) -> None:
    write_buildings(tmp_path)
    index = index_of(tmp_path)
    T_new_old = Pose2(-4, 7, 2.5)
    found = find(seen_from(office(), T_new_old), index)
    assert {c.path.name for c in found[:2]} == {"office.yaml", "west.yaml"}
    results = {c.path.name: c.result for c in found}
    for name, T in (("office.yaml", T_new_old.inverse()), ("west.yaml", T_B_A @ T_new_old.inverse())):
        result = results[name]
        assert result is not None
        assert result.verdict is Verdict.ACCEPTED
        assert result.T_a_b is not None
        metres, radians = result.T_a_b.distance_to(T)
        assert metres < 0.2
        assert radians < 0.02
    other = results.get("school.yaml")
    assert other is None or other.verdict is not Verdict.ACCEPTED


def test_its_own_file_is_left_out_and_others_fill_the_places(tmp_path: Path) -> None:
    write_buildings(tmp_path)
    index = index_of(tmp_path)
    (tmp_path / "link.yaml").symlink_to(tmp_path / "office.yaml")
    (first,) = candidates_for(office(), index, top=1)
    assert first.path.name == "office.yaml"
    assert first.score == pytest.approx(1, abs=1e-6)
    (other,) = candidates_for(office(), index, top=1, but=tmp_path / "link.yaml")
    assert other.path.name != "office.yaml"


def test_a_map_that_is_gone_is_said_and_the_others_are_matched(tmp_path: Path) -> None:
    write_buildings(tmp_path)
    index = index_of(tmp_path)
    (tmp_path / "office.yaml").unlink()
    calls: list[int] = []
    found = find(office(), index, on_candidate=lambda: calls.append(1))
    assert len(calls) == len(found)
    assert found[0].path.name == "west.yaml"
    (gone,) = (c for c in found if c.problem)
    assert gone is found[-1]
    assert "office.yaml: no such file" in gone.problem


def test_nothing_looks_like_a_map_without_walls(tmp_path: Path) -> None:
    write_buildings(tmp_path)
    assert find(drawn("..."), index_of(tmp_path)) == ()


def test_another_place_is_found_nowhere(tmp_path: Path) -> None:
    write_buildings(tmp_path)
    found = find(hall(), index_of(tmp_path))
    assert all(c.result is None or c.result.verdict is not Verdict.ACCEPTED for c in found)


def test_an_unknown_method_is_no_problem_of_the_maps(tmp_path: Path) -> None:
    write_buildings(tmp_path)
    with pytest.raises(UnknownMethodError):
        find(office(), index_of(tmp_path), method="none")
