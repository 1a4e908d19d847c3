"""SLAM on board: what it explores with, and the states of the map that it gives."""

import math

import numpy as np
from small import two_rooms

from mapmeld.evaluation import accuracy
from mapmeld.grid import UNKNOWN
from mapmeld.recording import Laser, Scan
from mapmeld.se2 import Pose2
from mapmeld.simulation import FrontierDriver, Sight, TourDriver, World, drive, plan_tours, true_map
from mapmeld.simulation.slam_mapper import MappingDriver, SlamMapper, onboard_parameters
from mapmeld.simulation.tour import FloorPlan
from mapmeld.slam import GMappingParameters, states

FEW = GMappingParameters(particles=3, linearUpdate=0.2, maxRange=math.inf, maxUrange=5.0)
LASER = Laser(9, -1.0, 0.25, 5.0)


def scan(stamp: float, x: float, metres: float = 2.0) -> Scan:
    return Scan(stamp, Pose2(x), np.full(9, metres, np.float32))


def test_exploration_on_its_own_map_sees_all_and_its_map_is_true() -> None:
    environment = two_rooms()
    start = Pose2(2.0, 3.5, 2.0)
    world = World(environment, [start], seed=3)
    mapper = SlamMapper(world.build.laser, seed=1)
    for _ in drive(world, [FrontierDriver(mapper)], 120.0):
        pass
    assert world.time < 110.0
    grid = mapper.grid()
    assert grid.known_area > 28.0
    assert accuracy(grid, true_map(environment), start) > 0.9
    metres, radians = (start @ mapper.pose()).distance_to(world.true_pose(0))
    assert metres < 0.2
    assert radians < 0.1


def test_true_poses_are_not_looked_at() -> None:
    honest, lied_to = SlamMapper(LASER, FEW), SlamMapper(LASER, FEW)
    for i in range(5):
        honest.add(scan(i / 10, i / 10), Pose2(i / 10))
        lied_to.add(scan(i / 10, i / 10), Pose2(50.0 * i, -3.0, 1.0))
    assert honest.grid() == lied_to.grid()
    assert honest.pose() == lied_to.pose()


def test_a_state_for_every_second_in_which_the_map_changed() -> None:
    moved = [0, 0.3, 0.6, 0.9, 0.9, 0.9, 0.9, 1.2]
    scans = [scan(0.4 * i, x) for i, x in enumerate(moved)]
    mapper, taken = SlamMapper(LASER, FEW), []
    for one in scans:
        mapper.add(one, Pose2())
        taken.append(mapper.take_state())
    mapper.finish()
    taken.append(mapper.take_state())
    mapper.finish()
    taken.append(mapper.take_state())
    assert [i for i, state in enumerate(taken) if state is not None] == [3, 5, 8]
    found = [state for state in taken if state is not None]
    # As the history of the same scans has it.
    expected = list(states(SlamMapper(LASER, FEW).slam, scans))
    assert found == expected
    assert [state.stamp for state in found] == [state.stamp for state in expected]


def test_before_anything_is_met_there_is_one_unknown_cell() -> None:
    mapper = SlamMapper(LASER)
    assert mapper.grid().cells.tolist() == [[UNKNOWN]]
    mapper.finish()
    assert mapper.take_state() is None
    driver = FrontierDriver(SlamMapper(LASER, FEW))
    assert driver.command(Sight(0.0, Pose2())) == (0.0, 0.0)
    assert driver.command(Sight(2.0, Pose2())) is None


def test_whoever_drives_the_map_is_fed() -> None:
    environment = two_rooms()
    plan = FloorPlan(environment)
    tour = plan_tours(environment, 1, plan=plan)[0]
    world = World(environment, [tour.start])
    mapper = SlamMapper(world.build.laser, FEW)
    commands = [
        moment.command for moment in drive(world, [MappingDriver(TourDriver(plan, tour.stops), mapper)], 5.0)
    ]
    alone = World(environment, [tour.start])
    assert commands == [m.command for m in drive(alone, [TourDriver(plan, tour.stops)], 5.0)]
    assert mapper.grid().known_area > 5


def test_other_robots_are_where_they_are_seen_from_the_robot() -> None:
    """On a map whose frame is another, they must not stand in the way elsewhere."""
    environment = two_rooms()
    starts = [Pose2(2.0, 3.5, 2.0), Pose2(7.0, 2.5, 0.0)]
    world = World(environment, starts, seed=1)
    mappers = [SlamMapper(world.build.laser, seed=i) for i in range(2)]
    for _ in drive(world, [FrontierDriver(m, seed=i) for i, m in enumerate(mappers)], 150.0):
        pass
    assert all(mapper.grid().known_area > 25 for mapper in mappers)


def test_the_settings_on_board_see_as_far_as_the_laser() -> None:
    parameters = onboard_parameters(LASER)
    assert parameters.maxUrange == 5.0
    assert parameters.maxRange == math.inf
