import math

import numpy as np
from drawing import drawn
from small import two_rooms

from mapmeld.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mapmeld.recording import Laser, Scan
from mapmeld.se2 import Pose2
from mapmeld.simulation import FrontierDriver, KnownPoseMapper, Sight, World, drive, true_map
from mapmeld.simulation.frontier import frontiers

OPEN_TO_THE_RIGHT = """
##########
#.......
#.......
#.......
#.......
#.......
#.......
##########
"""


def test_a_frontier_lies_between_floor_and_the_unknown_not_at_walls() -> None:
    places, sizes = frontiers(drawn(OPEN_TO_THE_RIGHT, 0.1))
    assert places.shape == (1, 2)
    assert np.allclose(places[0], (0.75, 0.45), atol=0.11)
    assert np.allclose(sizes, 0.4, atol=0.05)


def test_no_frontier_in_a_closed_map_or_an_unknown_one() -> None:
    assert len(frontiers(drawn("####\n#..#\n####", 0.1))[0]) == 0
    assert len(frontiers(drawn("    \n    ", 0.1))[0]) == 0


def test_the_mapper_marks_floor_and_walls() -> None:
    laser = Laser(beams=5, first_angle=-0.02, step=0.01, max_range=5.0)
    mapper = KnownPoseMapper((10.0, 10.0), laser, 0.1)
    pose = Pose2(3.0, 3.0, math.pi / 2)
    ranges = np.array([2.05, 2.05, 2.05, np.inf, 0.0], np.float32)
    mapper.add(Scan(0.0, Pose2(), ranges), pose)
    grid = mapper.grid()

    def at(x: float, y: float) -> int:
        col, row = np.floor(grid.metres_to_lattice((x, y))).astype(int)
        return int(grid.cells[row, col])

    assert at(3.03, 5.05) == OCCUPIED
    assert at(3.03, 4.0) == FREE
    assert at(3.03, 9.0) == UNKNOWN
    assert at(2.96, 7.5) == FREE  # the beam that met nothing saw floor
    assert mapper.pose() == pose


def test_scans_from_the_same_place_count_once() -> None:
    laser = Laser(beams=3, first_angle=-0.01, step=0.01, max_range=5.0)
    mapper = KnownPoseMapper((6.0, 6.0), laser, 0.1)
    near, far = (np.full(3, r, np.float32) for r in (1.0, 3.0))
    mapper.add(Scan(0.0, Pose2(), near), Pose2(2.0, 2.0))
    before = mapper.grid()
    mapper.add(Scan(0.1, Pose2(), far), Pose2(2.01, 2.0))
    assert mapper.grid() == before
    mapper.add(Scan(0.2, Pose2(), far), Pose2(2.5, 2.0))
    assert mapper.grid() != before


def test_exploration_maps_both_rooms_and_ends() -> None:
    environment = two_rooms()
    world = World(environment, [Pose2(2.0, 3.5, 2.0)])
    mapper = KnownPoseMapper(environment.size, world.build.laser)
    for _ in drive(world, [FrontierDriver(mapper)], 120.0):
        pass
    assert world.time < 100.0
    truth, grid = true_map(environment), mapper.grid()
    centres = truth.centres(truth.free)
    col, row = np.floor(grid.metres_to_lattice(centres)).astype(int).T
    assert (grid.cells[row, col] == FREE).mean() > 0.93  # some beams end short of a wall


def test_any_mapper_will_do_and_its_frame_may_be_another() -> None:
    """As SLAM has it: the map's frame is where the robot began."""
    environment = two_rooms()
    start = Pose2(2.0, 3.5, 2.0)

    class Moved:
        def __init__(self) -> None:
            self.inner = KnownPoseMapper(environment.size, World(environment, []).build.laser)

        def add(self, scan: Scan, T_world_base: Pose2) -> None:
            self.inner.add(scan, T_world_base)

        def grid(self) -> OccupancyGrid:
            return self.inner.grid().moved(start.inverse())

        def pose(self) -> Pose2:
            return start.inverse() @ self.inner.pose()

    mapper = Moved()
    world = World(environment, [start])
    for _ in drive(world, [FrontierDriver(mapper)], 120.0):
        pass
    assert world.time < 110.0
    assert mapper.grid().known_area > 28.0


def test_a_robot_that_sees_nothing_gives_up() -> None:
    class Blind:
        def add(self, scan: Scan, T_world_base: Pose2) -> None:
            pass

        def grid(self) -> OccupancyGrid:
            return drawn("   \n   ", 0.5)

        def pose(self) -> Pose2:
            return Pose2()

    driver = FrontierDriver(Blind())
    assert driver.command(Sight(0.0, Pose2())) == (0.0, 0.0)
    assert driver.command(Sight(2.0, Pose2())) is None
