"""An office drawn by hand, and robots that map it by ray casting with a mild drift: pairs for changes.py.

No physics and no SLAM: thousands of scans a second, and what the robots believe is known exactly.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from mapmeld.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mapmeld.se2 import Pose2

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

PLAN_RESOLUTION = 0.025  # finer than the maps [m], so that the plan's own cells do not show in them
MAP_RESOLUTION = 0.05
WALL = 0.1  # thickness [m]
CHAIR = (0.44, 0.42)  # length, width [m]
LEG = 0.06  # of a table or chair [m]

RANGE = 5.0  # of the laser [m]
BEARINGS = np.radians(np.linspace(-120.0, 120.0, 480))
RANGE_SIGMA = 0.01  # [m]
STEP, TURN = 0.15, math.radians(12.0)  # a scan at least this often [m], [rad]
ROBOT_RADIUS = 0.25  # [m]
DRIFT = np.array([0.05, 0.05, math.radians(0.5)])  # the worst of the believed pose on a route
JITTER = np.array([0.005, 0.005, math.radians(0.1)])  # of each scan on top of it, sigma

HIT, MISS = 0.9, -0.35  # log-odds of a cell a beam ends in, passes through
LOG_ODDS_LIMIT = 4.0


@dataclass(frozen=True)
class Building:
    """A floor plan in metres, drawn with rectangles; angles in degrees.

    Attributes
    ----------
    size
        Width and height of the floor.
    walls, doors
        Segments (x0, y0, x1, y1); a door is a hole in a wall.
    boxes
        Cabinets, columns and the like, solid: (x, y, length, width, angle) about the centre.
    tables
        The same form; the laser sees only the four legs.
    chairs
        As tables of one size: (x, y, angle).
    """

    size: tuple[float, float]
    walls: tuple[tuple[float, float, float, float], ...]
    doors: tuple[tuple[float, float, float, float], ...]
    boxes: tuple[tuple[float, float, float, float, float], ...]
    tables: tuple[tuple[float, float, float, float, float], ...]
    chairs: tuple[tuple[float, float, float], ...] = ()


@dataclass(frozen=True)
class Tour:
    """Where a robot starts (x, y [m], heading [rad], in the building's frame) and passes by."""

    start: Pose2
    stops: tuple[tuple[float, float], ...]


OFFICE = Building(
    size=(20.0, 16.0),
    walls=(
        # outline, counter-clockwise
        (0, 0, 20, 0), (20, 0, 20, 10.6), (20, 10.6, 14.5, 10.6), (14.5, 10.6, 14.5, 16),
        (14.5, 16, 3, 16), (3, 16, 3, 12.8), (3, 12.8, 0, 11.6), (0, 11.6, 0, 0),
        # south of the corridor
        (0, 6.2, 20, 6.2), (5.3, 0, 5.3, 6.2), (8.5, 0, 8.5, 6.2), (5.3, 3.3, 8.5, 3.3), (14.7, 0, 14.7, 6.2),
        # north of it, on both sides of the short corridor
        (4.4, 8, 8.9, 8), (10.5, 8, 20, 8), (4.4, 8, 4.4, 12.2), (3, 12.2, 8.9, 12.2), (3, 12.2, 3, 12.8),
        (8.9, 8, 8.9, 16), (10.5, 8, 10.5, 16), (8.9, 14.3, 10.5, 14.3), (10.5, 11.4, 14.5, 11.4),
        (16.9, 8, 16.9, 10.6),
        # leaves of open doors
        (4.0, 6.2, 4.3, 5.3), (11.4, 6.2, 11.2, 5.3), (10.5, 12.2, 11.4, 12.0),
    ),
    doors=(
        (3.0, 6.2, 4.0, 6.2), (7.1, 6.2, 8.1, 6.2), (5.3, 1.2, 5.3, 2.2), (11.4, 6.2, 12.4, 6.2),
        (14.7, 1.0, 14.7, 2.0), (17.6, 6.2, 18.6, 6.2), (5.0, 8, 6.0, 8), (8.9, 12.7, 8.9, 13.7),
        (10.5, 9.1, 10.5, 10.1), (10.5, 12.2, 10.5, 13.2), (15.2, 8, 16.2, 8), (18.6, 8, 19.6, 8),
        (9.2, 14.3, 10.1, 14.3),
    ),
    boxes=(
        (0.35, 3.2, 0.5, 1.8, 0), (2.4, 0.3, 1.6, 0.45, 0), (4.95, 4.4, 0.5, 1.2, 0),  # south-west office
        (6.2, 0.4, 1.5, 0.6, 0), (8.15, 1.6, 0.5, 1.4, 0), (5.7, 4.7, 0.6, 2.2, 0), (7.2, 3.65, 1.8, 0.5, 0),
        (9.6, 0.3, 1.8, 0.45, 0), (14.4, 4.3, 0.4, 2.0, 0),  # meeting room
        (19.65, 2.2, 0.5, 2.4, 0), (16.0, 5.9, 1.4, 0.4, 0), (16.3, 0.35, 0.9, 0.5, 0),  # south-east office
        (1.9, 9.6, 0.5, 0.5, 0), (0.4, 8.0, 0.6, 2.1, 0), (3.9, 11.2, 0.7, 0.7, 30),  # lobby
        (8.6, 9.3, 0.4, 1.6, 0), (7.0, 11.9, 1.9, 0.4, 0), (4.0, 15.6, 1.2, 0.6, 0), (8.5, 15.2, 0.5, 1.0, 0),
        (14.2, 9.0, 0.4, 1.2, 0), (12.0, 11.05, 1.3, 0.5, 0), (14.1, 15.3, 0.6, 1.1, 0),
        (12.4, 15.7, 1.5, 0.4, 0), (15.2, 10.2, 1.1, 0.5, 0), (19.6, 10.1, 0.6, 0.8, 0),
        (13.6, 7.75, 1.4, 0.35, 0), (6.5, 6.45, 0.9, 0.3, 0),
    ),
    tables=(
        (2.6, 3.4, 1.6, 0.8, 8), (1.6, 1.7, 1.4, 0.7, 95), (7.1, 1.7, 1.0, 0.6, 0),
        (11.6, 2.6, 2.8, 1.2, -12), (17.2, 3.6, 1.6, 0.8, 90), (6.9, 10.2, 1.6, 0.8, 14),
        (6.0, 14.2, 2.2, 1.0, 0), (12.7, 13.7, 1.4, 0.8, 62), (12.9, 9.7, 1.2, 0.7, -5),
        (18.6, 9.6, 0.9, 0.6, 0),
    ),
    chairs=(
        (2.7, 4.2, 15), (2.3, 2.6, 200), (0.8, 1.5, 80), (10.6, 3.8, -30), (11.9, 3.6, 5),
        (11.2, 1.6, 170), (13.3, 1.6, 110), (16.3, 3.7, 85), (17.9, 3.2, 60), (7.2, 9.3, 20),
        (6.0, 10.9, 150), (5.3, 13.2, 12), (6.7, 15.1, 175), (7.6, 14.3, 90), (13.2, 12.8, 40),
        (12.6, 8.8, 0), (3.3, 9.2, 50),
    ),
)  # fmt: skip

TOURS = {
    "robot_1": Tour(
        Pose2(1.3, 6.9, 0.4),
        ((3.5, 7.1), (3.5, 4.9), (1.2, 4.6), (3.9, 2.0), (3.5, 5.0), (3.2, 10.6), (3.4, 7.2), (5.6, 8.9),
         (5.6, 7.1), (7.6, 5.4), (7.6, 6.9), (11.9, 7.1), (12.2, 4.9), (9.6, 2.6), (13.6, 2.9),
         (11.9, 5.4), (9.7, 7.2), (9.7, 8.6)),
    ),
    "robot_2": Tour(
        Pose2(18.2, 4.6, 2.2),
        ((18.3, 1.2), (15.5, 1.6), (13.8, 1.2), (13.6, 4.4), (11.9, 5.2), (14.6, 7.0), (15.7, 8.9),
         (15.7, 7.1), (19.1, 7.0), (19.1, 8.9), (15.5, 7.1), (9.7, 7.2), (9.7, 9.6), (11.6, 9.6),
         (9.7, 9.8), (9.7, 12.6), (12.0, 12.8), (9.7, 12.6), (9.7, 7.2), (6.6, 7.1)),
    ),
    "robot_3": Tour(
        Pose2(11.5, 14.6, -1.9),
        ((12.3, 12.4), (9.7, 12.8), (7.9, 13.2), (4.4, 13.4), (9.7, 13.2), (9.7, 9.6), (11.2, 9.6),
         (9.7, 9.4), (9.7, 7.2), (5.5, 7.1), (5.6, 9.6), (5.5, 7.1), (7.6, 5.4), (7.6, 6.9), (2.9, 7.2),
         (1.1, 10.4), (3.5, 7.2), (3.5, 5.3)),
    ),
}  # fmt: skip


# ---------------------------------------------------------------------- the floor plan
def fill(mask: Bools, box: Iterable[float], value: bool = True) -> None:
    """Set the plan's cells with centres in a box (x, y, length, width [m], angle [degrees]), in place."""
    x, y, length, width, angle = box
    reach = math.hypot(length, width) / 2 + PLAN_RESOLUTION
    (c0, r0), (c1, r1) = (
        np.maximum(0, (np.array((x, y)) + WALL + d) / PLAN_RESOLUTION).astype(int) for d in (-reach, reach)
    )
    part = mask[r0 : r1 + 1, c0 : c1 + 1]
    rows, cols = np.indices(part.shape)
    centres = np.stack([cols + c0 + 0.5, rows + r0 + 0.5], axis=-1) * PLAN_RESOLUTION - WALL
    u = np.abs(Pose2(x, y, math.radians(angle)).inverse().apply(centres))
    part[(u[..., 0] <= length / 2) & (u[..., 1] <= width / 2)] = value


def draw(building: Building) -> tuple[OccupancyGrid, OccupancyGrid]:
    """Return the floor as the laser sees it, and with the tables' full footprints to drive around."""
    shape = [round((side + 2 * WALL) / PLAN_RESOLUTION) for side in reversed(building.size)]
    seen = np.zeros(shape, np.bool_)
    for segments, width, value in ((building.walls, WALL, True), (building.doors, 2 * WALL, False)):
        for x0, y0, x1, y1 in segments:
            # Walls reach half a thickness past their ends, so that corners close; doors do not.
            length = math.hypot(x1 - x0, y1 - y0) + (WALL if value else 0.0)
            angle = math.degrees(math.atan2(y1 - y0, x1 - x0))
            fill(seen, ((x0 + x1) / 2, (y0 + y1) / 2, length, width, angle), value)
    for box in building.boxes:
        fill(seen, box)
    blocked = seen.copy()
    chairs = ((x, y, *CHAIR, angle) for x, y, angle in building.chairs)
    for x, y, length, width, angle in (*building.tables, *chairs):
        fill(blocked, (x, y, length, width, angle))
        corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (length - LEG, width - LEG) / 2
        for leg_x, leg_y in Pose2(x, y, math.radians(angle)).apply(corners):
            fill(seen, (leg_x, leg_y, LEG, LEG, angle))
    origin = Pose2(-WALL, -WALL, 0.0)
    seen_grid, blocked_grid = (
        OccupancyGrid(np.where(mask, OCCUPIED, FREE), PLAN_RESOLUTION, origin) for mask in (seen, blocked)
    )
    return seen_grid, blocked_grid


# ---------------------------------------------------------------------- the drive
def shortest_paths(blocked: OccupancyGrid, stops: Iterable[tuple[float, float]], stride: int = 4) -> Floats:
    """Return points (n, 2) [m] from stop to stop, keeping away from what is in the way.

    Dijkstra's algorithm on every `stride`-th cell, eight neighbours; a step costs its length,
    and more the closer it is to an obstacle.
    """
    clearance = cv2.distanceTransform((~blocked.occupied).astype(np.uint8), cv2.DIST_L2, 5)
    clearance = clearance[::stride, ::stride] * blocked.resolution
    node = np.arange(clearance.size).reshape(clearance.shape)
    cost = np.where(clearance > ROBOT_RADIUS, 1.0 + (0.5 / np.maximum(clearance, 0.01)) ** 2, np.inf)
    rows, cols = clearance.shape
    edges: list[tuple[Floats, NDArray[np.int64], NDArray[np.int64]]] = []
    for dr, dc in ((0, 1), (1, 0), (1, 1), (1, -1)):
        here = np.s_[: rows - dr, max(0, -dc) : cols - max(0, dc)]
        there = np.s_[dr:, max(0, dc) : cols + min(0, dc)]
        weight = (cost[here] + cost[there]) / 2 * math.hypot(dr, dc)
        ok = np.isfinite(weight)
        edges.append((weight[ok], node[here][ok], node[there][ok]))
    weights, tails, heads = (np.concatenate(part) for part in zip(*edges, strict=True))
    graph = coo_matrix((weights, (tails, heads)), shape=(node.size, node.size)).tocsr()

    lattice = np.floor(blocked.metres_to_lattice(list(stops)) / stride).astype(int)
    targets = [int(node[row, col]) for col, row in lattice]
    path = [targets[0]]
    for start, goal in pairwise(targets):
        _, before = dijkstra(graph, directed=False, indices=[start], return_predecessors=True)
        leg = [goal]
        while leg[-1] != start:
            leg.append(int(before[0, leg[-1]]))
            if leg[-1] < 0:
                raise ValueError(f"no way for the robot between nodes {start} and {goal} of the plan")
        path += leg[-2::-1]
    row, col = np.divmod(np.array(path), cols)
    return blocked.lattice_to_metres(np.stack([col, row], axis=-1) * stride + 0.5)


def drive(blocked: OccupancyGrid, tour: Tour) -> Floats:
    """Return the poses (n, 3) [m, m, rad] at which the robot takes a scan, smooth and turning on the spot."""
    start = (tour.start.x, tour.start.y)
    path = gaussian_filter1d(shortest_paths(blocked, (start, *tour.stops)), 2.0, axis=0, mode="nearest")
    path = path[np.hypot(*np.diff(path, axis=0, prepend=path[:1] - 1.0).T) > 0.01]
    ahead = np.diff(path, axis=0, append=2 * path[-1:] - path[-2:-1])
    heading = np.concatenate([[tour.start.theta], np.arctan2(ahead[:, 1], ahead[:, 0])])
    poses = np.column_stack([np.vstack([start, path]), np.unwrap(heading)])
    change = np.diff(poses, axis=0, prepend=poses[:1])
    # Way travelled and angle turned, counted in scans: equal steps of it are the scans' places.
    effort = np.cumsum(np.hypot(change[:, 0], change[:, 1]) / STEP + np.abs(change[:, 2]) / TURN)
    at = np.arange(0.0, effort[-1])
    return np.column_stack([np.interp(at, effort, column) for column in poses.T])


def drift(count: int, rng: np.random.Generator) -> Floats:
    """Return pose errors (count, 3): zero at first, then random walks that reach `DRIFT`, and jitter."""
    walk = np.cumsum(rng.normal(size=(count, 3)), axis=0)
    walk -= walk[0]
    walk *= DRIFT / np.maximum(np.abs(walk).max(axis=0), 1e-9)
    walk[1:] += rng.normal(size=(count - 1, 3)) * JITTER
    return walk


# ---------------------------------------------------------------------- laser and mapping
def cast_rays(plan: OccupancyGrid, pose: Pose2, bearings: Floats, reach: float = RANGE) -> Floats:
    """Return the distance [m] along each bearing [rad] to the first occupied cell; inf beyond `reach`.

    All beams march together in steps of half a cell. The floor must be closed: what leaves the
    plan meets the plan's edge cells.
    """
    step = 0.5
    steps = np.arange(step, reach / plan.resolution, step)
    angles = pose.theta - plan.origin.theta + bearings
    col0, row0 = plan.metres_to_lattice((pose.x, pose.y))
    rows = np.clip((row0 + np.outer(np.sin(angles), steps)).astype(np.intp), 0, plan.shape[0] - 1)
    cols = np.clip((col0 + np.outer(np.cos(angles), steps)).astype(np.intp), 0, plan.shape[1] - 1)
    hit = plan.cells[rows, cols] == OCCUPIED
    first = hit.argmax(axis=1)
    # The surface lies somewhere within the last step: half of it is the unbiased guess.
    return np.where(hit.any(axis=1), (steps[first] - step / 2) * plan.resolution, np.inf)


def add_scan(log_odds: Floats, position: Floats, angles: Floats, ranges: Floats) -> None:
    """Lower the cells that beams pass and raise those they end in, each once per scan, in place.

    `position` (col, row) and `ranges` are in cells of `log_odds`; an infinite range sees free floor
    as far as the laser reaches.
    """
    along = np.arange(0.0, RANGE / MAP_RESOLUTION, 0.5)
    direction = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    cells = (position + direction[:, None] * along[:, None]).astype(np.intp)
    cols, rows = cells[along < ranges[:, None] - 0.5].T
    hits = np.isfinite(ranges)
    hit_cols, hit_rows = (position + direction[hits] * ranges[hits, None]).astype(np.intp).T
    # Assigning through an index counts a cell once however many beams meet it; a hit outweighs a miss.
    change = np.zeros_like(log_odds)
    change[rows, cols] = MISS
    change[hit_rows, hit_cols] = HIT
    log_odds += change
    np.clip(log_odds, -LOG_ODDS_LIMIT, LOG_ODDS_LIMIT, out=log_odds)


def grow(
    building: Building, tour: Tour, rng: np.random.Generator, every: int
) -> Iterator[tuple[int, OccupancyGrid]]:
    """Drive the tour; give the robot's map after every so many scans, and after the last, with their number.

    The origin of the map's frame is the start pose.
    """
    plan, blocked = draw(building)
    true = drive(blocked, tour)
    T_map_plan = tour.start.inverse()
    errors = drift(len(true), rng)
    believed = np.column_stack([T_map_plan.apply(true[:, :2]), true[:, 2] + T_map_plan.theta]) + errors
    corner = np.floor(believed[:, :2].min(axis=0) - RANGE - 1.0)
    size = np.ceil((believed[:, :2].max(axis=0) + RANGE + 1.0 - corner) / MAP_RESOLUTION).astype(int)
    log_odds = np.zeros((size[1], size[0]))
    for scans, ((x, y, theta), (bx, by, b_theta)) in enumerate(zip(true, believed, strict=True), start=1):
        ranges = cast_rays(plan, Pose2(x, y, theta), BEARINGS) + rng.normal(0.0, RANGE_SIGMA, BEARINGS.size)
        position = (np.array((bx, by)) - corner) / MAP_RESOLUTION
        add_scan(log_odds, position, b_theta + BEARINGS, ranges / MAP_RESOLUTION)
        if scans % every == 0 or scans == len(true):
            cells = np.full(log_odds.shape, UNKNOWN, np.int8)
            cells[log_odds < 0] = FREE
            cells[log_odds > 0] = OCCUPIED
            whole = OccupancyGrid(cells, MAP_RESOLUTION, Pose2(float(corner[0]), float(corner[1])))
            yield scans, whole.cropped(margin=5)


def simulate(building: Building, tour: Tour, rng: np.random.Generator) -> OccupancyGrid:
    """Drive the tour and return the robot's map; its frame's origin is the start pose."""
    *_, (_, final) = grow(building, tour, rng, every=sys.maxsize)
    return final
