from dataclasses import replace

import numpy as np
import pytest
from drawing import drawn, hall, office, school, seen_from
from floors import area_in, bowed, with_box
from hypothesis import given, settings
from hypothesis import strategies as st

import mapmeld
from mapmeld.changes import Change, MapDiff, NoMatchError, diff
from mapmeld.grid import OccupancyGrid, ResolutionError
from mapmeld.matching import Verdict
from mapmeld.merging import MergeError
from mapmeld.se2 import Pose2

OFFICE = office(0.05)
# On the open floor of the office, far from walls.
NEW_BOX, OLD_BOX = (1.0, 9.0, 2.2, 9.6), (6.0, 4.0, 6.4, 5.0)
EARLIER, LATER = with_box(OFFICE, *OLD_BOX), with_box(OFFICE, *NEW_BOX)
T_B_A = Pose2(3.0, -2.0, 0.7)


def kinds(found: MapDiff) -> list[str]:
    return [region.kind for region in found.regions]


def test_what_came_and_what_went() -> None:
    found = mapmeld.diff(EARLIER, LATER)
    assert kinds(found) == ["appeared", "vanished"]
    appeared, vanished = found.regions
    assert appeared.bounds == pytest.approx(NEW_BOX, abs=1e-9)
    assert vanished.bounds == pytest.approx(OLD_BOX, abs=1e-9)
    assert appeared.centroid == pytest.approx((1.6, 9.3))
    assert appeared.area_m2 == pytest.approx(1.2 * 0.6) == found.area(Change.APPEARED)
    assert found.match is not None
    assert found.match.verdict is Verdict.ACCEPTED
    assert "0.72 m2 of obstacles appeared in 1 place;" in found.summary
    assert "0.40 m2 of obstacles vanished in 1 place;" in found.summary


def test_all_that_comes_of_it_is_in_the_earlier_maps_frame_and_of_the_later_moment() -> None:
    old, new = replace(EARLIER, stamp=3.0, frame_id="map"), replace(LATER, stamp=12.0, frame_id="map_2")
    found = diff(old, new, T_old_new=Pose2())
    assert (found.old.frame_id, found.new.frame_id) == ("map", "map")
    assert (found.old.stamp, found.new.stamp) == (3.0, 12.0)
    for made in (found.as_map(), found.updated()):
        assert (made.stamp, made.frame_id) == (12.0, "map")


def test_a_map_and_itself() -> None:
    found = diff(OFFICE, OFFICE)
    assert found.regions == ()
    assert (found.classes == Change.SAME).all()
    assert found.updated() == OFFICE
    assert "0.00 m2 of obstacles appeared;" in found.summary


@settings(max_examples=15)
@given(st.from_type(Pose2))
def test_another_frame_changes_nothing(T: Pose2) -> None:
    plain = diff(EARLIER, LATER, T_old_new=Pose2())
    turned = diff(EARLIER, LATER.moved(T), T_old_new=T.inverse())
    np.testing.assert_array_equal(turned.classes, plain.classes)
    assert kinds(turned) == kinds(plain)
    # The changes are told in the earlier map's frame.
    moved = diff(EARLIER.moved(T), LATER, T_old_new=T)
    np.testing.assert_array_equal(moved.classes, plain.classes)
    for one, other in zip(moved.regions, plain.regions, strict=True):
        np.testing.assert_allclose(one.centroid, T.apply(other.centroid), atol=1e-9)
        np.testing.assert_allclose(one.outline, T.apply(other.outline), atol=1e-9)


def test_a_pure_change_of_origin_is_found_by_the_match() -> None:
    found = diff(OFFICE, OFFICE.moved(T_B_A))
    assert found.regions == ()
    assert found.T_old_new.distance_to(T_B_A.inverse())[0] < 0.05


@pytest.mark.parametrize("resolution", [0.04, 0.05, 0.1])
def test_a_map_on_another_lattice(resolution: float) -> None:
    found = diff(EARLIER, seen_from(LATER, T_B_A, resolution), T_old_new=T_B_A.inverse())
    assert kinds(found) == ["appeared", "vanished"]
    assert found.regions[0].bounds == pytest.approx(NEW_BOX, abs=0.15)
    assert found.regions[1].bounds == pytest.approx(OLD_BOX, abs=0.15)


def test_drift_is_no_change_and_a_change_is_seen_through_it() -> None:
    later = bowed(LATER, 0.5)
    bent = diff(EARLIER, later, T_old_new=Pose2())
    assert bent.bend > 0.1
    assert area_in(bent.classes == Change.APPEARED, bent.old, 0.7, 8.7, 2.5, 9.9) > 0.6
    assert area_in(bent.classes == Change.VANISHED, bent.old, 5.7, 3.7, 6.7, 5.3) > 0.3
    assert kinds(bent) == ["appeared", "vanished"]
    rigid = diff(EARLIER, later, T_old_new=Pose2(), max_bend=0)
    assert rigid.bend == 0
    assert len(rigid.regions) > 2


cells = st.sampled_from([-1, 0, 100])


@given(st.lists(st.lists(cells, min_size=8, max_size=8), min_size=6, max_size=6), st.data())
def test_with_roles_swapped_what_appeared_has_vanished(rows: list[list[int]], data: st.DataObject) -> None:
    a = np.array(rows, np.int8)
    b = a.copy()
    for _ in range(data.draw(st.integers(0, 12))):
        b[data.draw(st.integers(0, 5)), data.draw(st.integers(0, 7))] = data.draw(cells)
    one, other = OccupancyGrid(a, 0.5), OccupancyGrid(b, 0.5)
    there = diff(one, other, T_old_new=Pose2(), max_bend=0, tolerance=0.1)
    back = diff(other, one, T_old_new=Pose2(), max_bend=0, tolerance=0.1)
    np.testing.assert_array_equal(there.classes == Change.APPEARED, back.classes == Change.VANISHED)
    np.testing.assert_array_equal(there.classes == Change.VANISHED, back.classes == Change.APPEARED)
    np.testing.assert_array_equal(there.classes == Change.EXPLORED, back.classes == Change.UNSEEN)
    assert sum(r.area_m2 for r in there.regions) == pytest.approx(sum(r.area_m2 for r in back.regions))


def test_the_lattice_grows_and_old_cells_keep_their_place() -> None:
    old = drawn("....#\n.....", 0.5)
    new = drawn("##.......\n#........", 0.5, Pose2(-1.5, -0.5))
    found = diff(old, new, T_old_new=Pose2(), max_bend=0)
    assert found.classes.shape == (3, 9) == found.new.shape
    assert found.old.cells[1:, 3:8].tolist() == old.cells.tolist()
    assert found.old.origin == Pose2(-1.5, -0.5)
    assert found.area(Change.EXPLORED) == 0.25 * (9 + 4)
    assert found.area(Change.UNSEEN) == 0.25 * 5


def test_the_classes_as_a_map() -> None:
    old = OccupancyGrid(np.array([[0, 100, 0, 0, 0, 0, 0, -1, 0, -1]], np.int8), 0.1)
    new = OccupancyGrid(np.array([[0, 0, 0, 0, 0, 0, 100, 0, -1, -1]], np.int8), 0.1)
    # Single cells are no change.
    assert diff(old, new, T_old_new=Pose2(), max_bend=0).as_map().cells.tolist() == [
        [0, 0, 0, 0, 0, 0, 0, 40, 20, -1]
    ]
    old, new = (OccupancyGrid(np.repeat(grid.cells, 2, axis=0), 0.1) for grid in (old, new))
    as_map = diff(old, new, T_old_new=Pose2(), max_bend=0).as_map()
    assert as_map.cells.tolist() == 2 * [[0, 60, 0, 0, 0, 0, 100, 40, 20, -1]]
    assert as_map.occupied.tolist() == 2 * [[False] * 6 + [True] + [False] * 3]


def test_updated_takes_the_changes_and_keeps_the_rest() -> None:
    old = drawn("...#......#.. \n...#......#.. ", 0.1)
    new = drawn("#.........##..\n#.........##..", 0.1)
    found = diff(old, new, T_old_new=Pose2(), max_bend=0)
    # The wall that is thicker now stays as it was drawn.
    assert found.updated().cells.tolist() == drawn("#.........#...\n#.........#...", 0.1).cells.tolist()


def test_updated_keeps_what_was_not_seen_again() -> None:
    found = diff(drawn("..##", 0.1), drawn("..  ", 0.1), T_old_new=Pose2(), max_bend=0)
    assert found.updated().cells.tolist() == [[0, 0, 100, 100]]


def test_maps_that_do_not_match_are_refused_with_the_reason() -> None:
    with pytest.raises(NoMatchError, match="rejected: ") as refused:
        diff(OFFICE, school())
    assert refused.value.match.verdict is Verdict.REJECTED
    with pytest.raises(NoMatchError, match="ambiguous"):
        diff(hall(), hall())
    assert diff(hall(), hall(), T_old_new=Pose2()).regions == ()


def test_other_methods_can_match() -> None:
    found = diff(OFFICE, LATER, method="alphabet")
    assert found.match is not None
    assert found.match.method == "alphabet"
    assert kinds(found) == ["appeared"]


def test_coarse_cells_widen_the_tolerance() -> None:
    old, new = drawn("...#....", 0.2), drawn("....#...", 0.2)
    assert diff(old, new, T_old_new=Pose2(), tolerance=0, max_bend=0).regions == ()


@pytest.mark.parametrize("setting", ["tolerance", "max_bend", "min_area"])
@pytest.mark.parametrize("value", [-0.1, float("nan"), float("inf")])
def test_settings_that_make_no_sense(setting: str, value: float) -> None:
    with pytest.raises(ValueError, match=setting):
        diff(OFFICE, OFFICE, **{setting: value})  # type: ignore[arg-type]


def test_maps_that_cannot_be_laid_on_one_another() -> None:
    with pytest.raises(ResolutionError):
        diff(OFFICE, OccupancyGrid(OFFICE.cells, 50.0), T_old_new=Pose2())
    with pytest.raises(MergeError):
        diff(OFFICE, OFFICE, T_old_new=Pose2(1e7, 0, 0))


def test_maps_with_nothing_in_them() -> None:
    nothing = OccupancyGrid(np.full((3, 4), -1, np.int8), 0.1)
    assert (diff(nothing, nothing, T_old_new=Pose2()).classes == Change.UNKNOWN).all()
    assert diff(OFFICE, nothing, T_old_new=Pose2()).area(Change.UNSEEN) == pytest.approx(OFFICE.known_area)
    with pytest.raises(NoMatchError, match="nothing to match on"):
        diff(nothing, OFFICE)
