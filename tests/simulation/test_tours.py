import math

import numpy as np
import pytest
from small import fields, hall, two_rooms

from mapmeld.se2 import Pose2
from mapmeld.simulation import (
    Box,
    Configuration,
    Environment,
    FloorPlan,
    Furniture,
    Kind,
    Settings,
    SimulationError,
    TourDriver,
    World,
    drive,
    generate,
    plan_tours,
)
from mapmeld.simulation.fields import rooms_of


@pytest.fixture(scope="module")
def place() -> Environment:
    return generate(Settings(16, 14, Configuration(5, ((4, 5), (6, 4))), furniture=1.0), 2)


@pytest.fixture(scope="module")
def plan(place: Environment) -> FloorPlan:
    return FloorPlan(place)


def test_tours_share_rooms_and_start_elsewhere(place: Environment, plan: FloorPlan) -> None:
    tours = plan_tours(place, 4, 1, plan=plan)
    assert len(tours) == 4
    shared = set.intersection(*(set(tour.rooms) for tour in tours))
    area = np.bincount(rooms_of(place.fields).ravel()).astype(float)
    assert sum(area[list(shared)]) >= 0.35 * area.sum()
    for tour in tours:
        assert sum(area[list(tour.rooms)]) >= 0.65 * area.sum()
        assert len(tour.rooms) >= len(area[1:]) / 2
        assert len(tour.stops) >= len(tour.rooms)
        points = np.array([*tour.stops, (tour.start.x, tour.start.y)])
        assert set(plan.room_at(points)) <= set(tour.rooms)
    starts = [tour.start for tour in tours]
    apart = [a.distance_to(b)[0] for i, a in enumerate(starts) for b in starts[:i]]
    assert min(apart) > 1.5
    assert len({tour.start.theta for tour in tours}) == 4


def test_more_tours_begin_with_the_same(place: Environment, plan: FloorPlan) -> None:
    few, many = plan_tours(place, 2, 1, plan=plan), plan_tours(place, 3, 1, plan=plan)
    assert many[:2] == few
    assert plan_tours(place, 2, 2, plan=plan) != few


def test_shares_are_kept(place: Environment, plan: FloorPlan) -> None:
    (everything,) = plan_tours(place, 1, 1, common=0.1, share=1.0, plan=plan)
    assert set(everything.rooms) == set(range(1, int(rooms_of(place.fields).max()) + 1))
    (little,) = plan_tours(place, 1, 1, common=0.1, share=0.1, plan=plan)
    assert len(little.rooms) <= len(everything.rooms) / 3


@pytest.mark.parametrize(("common", "share"), [(0.7, 0.5), (-0.1, 0.5), (0.1, 1.1)])
def test_shares_out_of_range(place: Environment, plan: FloorPlan, common: float, share: float) -> None:
    with pytest.raises(SimulationError, match="common <= share"):
        plan_tours(place, 1, 1, common=common, share=share, plan=plan)


def test_no_floor_for_the_robot() -> None:
    with pytest.raises(SimulationError, match="no floor is wide enough"):
        plan_tours(Environment(fields("-2:-2:-2\n-2:1:-2\n-2:-2:-2")), 1)


def test_a_tour_passes_all_its_stops() -> None:
    environment = two_rooms()
    plan = FloorPlan(environment)
    stops = ((7.5, 1.5), (7.0, 3.5), (2.0, 3.5))
    driver = TourDriver(plan, stops)
    world = World(environment, [Pose2(1.5, 1.5, math.pi)])
    moments = list(drive(world, [driver], 60.0))
    assert world.time < 40.0
    assert driver.left_out == []
    way = np.array([(m.T_world_base.x, m.T_world_base.y) for m in moments])
    for stop in stops:
        assert np.hypot(*(way - stop).T).min() < 0.3
    assert np.hypot(*np.diff(way, axis=0).T).max() < 0.06  # 0.8 m/s in 0.05 s


def test_a_stop_out_of_reach_is_left_out() -> None:
    plan_text = "8:1:1:4:1:1:7\n0:-2:-2:0:-2:-2:0\n0:-2:-2:0:-2:-2:0\n9:1:1:5:1:1:6"
    environment = Environment(fields(plan_text))
    driver = TourDriver(FloorPlan(environment), ((5.0, 2.0), (2.0, 1.5)))
    world = World(environment, [Pose2(1.5, 2.5)])
    for moment in drive(world, [driver], 30.0):
        last = moment.T_world_base
    assert driver.left_out == [(5.0, 2.0)]
    assert math.dist((last.x, last.y), (2.0, 1.5)) < 0.3


def test_a_robot_frees_itself_from_what_the_plan_does_not_show() -> None:
    """A crate that came after the plan was drawn: the robot bumps into it, backs off and drives on."""
    crate = Furniture(Kind.BOX, Box(5.0, 3.6, 0.4, 0.4))
    world = World(Environment(hall().fields, (crate,)), [Pose2(2.0, 3.5)])
    driver = TourDriver(FloorPlan(hall()), ((8.0, 3.5), (2.0, 2.0)))
    nearest = math.inf
    for moment in drive(world, [driver], 90.0):
        last = moment.T_world_base
        nearest = min(nearest, math.dist((last.x, last.y), (2.0, 2.0)))
    assert world.time < 90.0
    assert driver.left_out in ([], [(8.0, 3.5)])
    assert nearest < 0.3  # the stop that is free is reached whatever becomes of the other


def test_two_robots_pass_one_another() -> None:
    environment = hall()
    plan = FloorPlan(environment)
    world = World(environment, [Pose2(2.0, 3.5), Pose2(8.0, 3.5, math.pi)])
    drivers = [TourDriver(plan, ((8.0, 3.5),), seed=1), TourDriver(plan, ((2.0, 3.5),), seed=2)]
    for _ in drive(world, drivers, 90.0):
        pass
    assert world.time < 90.0
    assert math.dist((world.true_pose(0).x, world.true_pose(0).y), (8.0, 3.5)) < 0.3
    assert math.dist((world.true_pose(1).x, world.true_pose(1).y), (2.0, 3.5)) < 0.3
