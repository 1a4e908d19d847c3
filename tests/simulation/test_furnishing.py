import cv2
import numpy as np
import pytest
from small import two_rooms

from mapmeld.simulation import Configuration, Environment, FloorPlan, Kind, Settings, furnish, generate
from mapmeld.simulation.fields import rooms_of
from mapmeld.simulation.furnishing import PASSAGE
from mapmeld.simulation.true_map import covered

SETTINGS = Settings(14, 13, Configuration(3, ((5, 5), (4, 6))), furniture=2.0)


@pytest.fixture(scope="module", params=[1, 2, 3])
def furnished(request: pytest.FixtureRequest) -> Environment:
    return generate(SETTINGS, request.param)


def test_a_robot_still_gets_into_every_room(furnished: Environment) -> None:
    resolution = 0.05
    blocked = covered(furnished, furnished.footprints(), resolution)
    room = cv2.distanceTransform((~blocked).astype(np.uint8), cv2.DIST_L2, 5) * resolution
    # Slightly less than the width that is kept free: cells round obstacles up.
    _, parts = cv2.connectedComponents((room > PASSAGE / 2 - 0.06).astype(np.uint8), connectivity=8)
    inside = rooms_of(furnished.fields)
    found = {
        int(np.bincount(part[part > 0]).argmax())
        for number in range(1, int(inside.max()) + 1)
        if (part := parts[10:-10, 10:-10][np.kron(inside == number, np.ones((20, 20), bool))]).any()
    }
    assert len(found) == 1


@pytest.mark.parametrize("seed", [*range(4), 19, 139, 148])  # the last ones: a table before the only door
def test_no_room_of_the_usual_environments_is_cut_off(seed: int) -> None:
    environment = generate(Settings(), seed)
    plan = FloorPlan(environment)
    reached = set(plan.room_at(plan.planner.main_floor()).tolist()) - {0}
    assert reached == set(range(1, int(plan.rooms.max()) + 1))


def test_pieces_stand_in_rooms_and_not_in_one_another(furnished: Environment) -> None:
    assert len(furnished.furniture) > 10
    taken = covered(furnished, furnished.walls(), 0.05).astype(int)
    for piece in furnished.furniture:
        taken += covered(furnished, [piece.footprint], 0.05)
    assert taken[taken > 0].max() == 1 or (taken > 1).mean() < 1e-3


def test_doors_are_kept_clear(furnished: Environment) -> None:
    for door in furnished.doors():
        for piece in furnished.furniture:
            x, y = piece.footprint.pose.inverse().apply((door.x, door.y))
            beyond = max(abs(x) - piece.footprint.length / 2, abs(y) - piece.footprint.width / 2)
            assert beyond > 0.6


def test_all_kinds_come_up_and_chairs_stand_at_tables() -> None:
    pieces = [p for seed in range(6) for p in generate(SETTINGS, seed).furniture]
    assert {p.kind for p in pieces} == set(Kind)


def test_density_and_seed() -> None:
    bare = two_rooms()
    assert furnish(bare, 1, 0.0) == bare
    assert furnish(bare, 1, 2.0) == furnish(furnish(bare, 5, 3.0), 1, 2.0)
    assert furnish(bare, 1, 2.0) != furnish(bare, 2, 2.0)
