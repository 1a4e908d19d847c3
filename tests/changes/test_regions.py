import numpy as np
import pytest
from drawing import drawn
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mapmeld.changes import Change, Region
from mapmeld.changes.regions import find_regions
from mapmeld.grid import OccupancyGrid
from mapmeld.se2 import Pose2

CLASS = {" ": Change.UNKNOWN, ".": Change.SAME, "+": Change.APPEARED, "-": Change.VANISHED}


def regions_of(
    picture: str, min_area: float = 2.0, gap: float = 1.5, lattice: OccupancyGrid | None = None
) -> tuple[tuple[Region, ...], np.ndarray]:
    lines = picture.strip("\n").split("\n")[::-1]
    classes = np.array([[CLASS[c] for c in line] for line in lines], np.uint8)
    return find_regions(
        classes, lattice or OccupancyGrid(np.zeros(classes.shape, np.int8), 1.0), min_area, gap
    )


def test_a_region_says_where_and_how_large() -> None:
    (region,), _ = regions_of("....\n.++.\n.+..")
    assert region.kind == "appeared"
    assert region.area_m2 == 3
    assert region.centroid == pytest.approx((1 + 5 / 6, 1 + 1 / 6))
    assert region.bounds == pytest.approx((1, 0, 3, 2))
    assert region.outline.tolist() == [[1, 0], [2, 0], [2, 1], [3, 1], [3, 2], [1, 2]]


def test_everything_is_in_the_frame_of_the_map() -> None:
    T = Pose2(10, -3, np.pi / 2)
    (region,), _ = regions_of(
        "....\n.++.", lattice=OccupancyGrid(np.zeros((2, 4), np.int8), 0.5, T), min_area=0
    )
    assert region.area_m2 == 0.5
    assert region.centroid == pytest.approx((10 - 0.25, -3 + 1.0))
    assert region.bounds == pytest.approx((9.5, -2.5, 10, -1.5))


def test_kinds_are_kept_apart_and_the_greatest_comes_first() -> None:
    regions, _ = regions_of("++..\n--..\n-...")
    assert [(r.kind, r.area_m2) for r in regions] == [("vanished", 3), ("appeared", 2)]


@pytest.mark.parametrize("picture", ["+....\n.....\n....+", "+.+", "+"])
def test_speckle_is_no_change(picture: str) -> None:
    regions, classes = regions_of(picture, min_area=3)
    assert regions == ()
    assert (classes == Change.SAME).all()


def test_a_single_cell_is_speckle_however_large() -> None:
    regions, classes = regions_of("+..\n...\n..+", min_area=0)
    assert regions == ()
    assert (classes == Change.SAME).all()


def test_the_least_area_itself_is_enough() -> None:
    lattice = OccupancyGrid(np.zeros((1, 5), np.int8), 0.05)
    assert len(regions_of(".+++.", min_area=3 * 0.05**2, lattice=lattice)[0]) == 1
    assert len(regions_of(".+++.", min_area=0.0076, lattice=lattice)[0]) == 0


def test_parts_nearer_than_the_gap_are_one_change_joined_by_a_strip() -> None:
    picture = "+..+\n....\n+..+"
    four, _ = regions_of(picture, gap=1.9, min_area=4)
    assert four == ()
    (region,), _ = regions_of(picture, gap=3.0, min_area=4)
    assert region.area_m2 == 4
    assert region.bounds == pytest.approx((0, 0, 4, 3))
    assert region.centroid == (2, 1.5)


def test_the_chain_is_as_long_as_its_links_are_short() -> None:
    (region,), _ = regions_of("+.+.+.+.+.+", gap=2.0)
    assert region.outline.tolist() == [[0, 0], [11, 0], [11, 1], [0, 1]]


def test_what_a_change_encloses_is_within_its_outline_but_not_its_area() -> None:
    (region,), _ = regions_of("+++\n+.+\n+++")
    assert region.area_m2 == 8
    assert region.outline.tolist() == [[0, 0], [3, 0], [3, 3], [0, 3]]


@given(
    arrays(np.uint8, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=st.sampled_from([0, 1, 2, 3])),
    st.floats(0, 6),
    st.floats(0, 5),
)
def test_regions_are_what_the_classes_say(classes: np.ndarray, min_area: float, gap: float) -> None:
    lattice = drawn("\n".join("." * classes.shape[1] for _ in classes))
    regions, cleaned = find_regions(classes, lattice, min_area, gap)
    for kind, change in (("appeared", Change.APPEARED), ("vanished", Change.VANISHED)):
        of_kind = [region for region in regions if region.kind == kind]
        assert sum(region.area_m2 for region in of_kind) == (cleaned == change).sum()
        assert all(region.area_m2 >= max(2, min_area - 1e-6) for region in of_kind)
        # Nothing but speckle was taken out, nothing put in.
        assert ((cleaned == change) <= (classes == change)).all()
        assert (cleaned[(classes == change) & (cleaned != change)] == Change.SAME).all()
        # With every patch within reach of every other there is one region at most.
    unchanged = ~np.isin(classes, (Change.APPEARED, Change.VANISHED))
    np.testing.assert_array_equal(cleaned[unchanged], classes[unchanged])
    everything, _ = find_regions(classes, lattice, 0, 100)
    assert len(everything) <= 2
