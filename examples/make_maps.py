"""Drive simulated robots through one office floor, each with SLAM of its own, and write their maps.

    python examples/make_maps.py --out somewhere

An environment is drawn at random and furnished, and three robots go through parts of it that overlap: MuJoCo
drives them, their wheels slip, and GMapping makes the maps of what their lasers see. A fourth map shows
another building, and a fifth the office again, after some furniture was moved, by robot 1 from another
start. ``floor.yaml`` is the true map of the office, and ``truth.yaml`` says how the maps really fit. The same
seed gives the same files. It takes the extra "sim", and about two minutes.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np
import yaml

from mapmeld.errors import MapmeldError
from mapmeld.grid import OccupancyGrid
from mapmeld.io import save
from mapmeld.io.atomic import check_targets, write_files
from mapmeld.recording import Scan
from mapmeld.se2 import Pose2
from mapmeld.simulation import (
    MECABOT,
    Configuration,
    Environment,
    FloorPlan,
    Furniture,
    Kind,
    Settings,
    Tour,
    TourDriver,
    World,
    drive,
    furnish,
    generate,
    plan_tours,
    true_map,
)
from mapmeld.slam import GMapping, GMappingParameters, states

SEED = 4

# Few rooms, and large ones.
OFFICE = Settings(
    width=20, height=14, configuration=Configuration(8, ((5, 6), (6, 5), (7, 4), (4, 5), (4, 4)))
)
OTHER = replace(OFFICE, width=13, height=12)

# Where robots go (west, south, east, north) and begin, in parts of the width and height of the floor.
PARTS = {
    "robot_1": ((0.0, 0.0, 0.6, 1.0), (0.0, 0.0)),
    "robot_2": ((0.4, 0.0, 1.0, 1.0), (1.0, 0.2)),
    "robot_3": ((0.0, 0.5, 1.0, 1.0), (0.6, 1.0)),
}
LATER_START = (0.5, 0.0)

SLAM = GMappingParameters(
    linearUpdate=0.3, angularUpdate=0.25, lskip=2, maxRange=math.inf, maxUrange=MECABOT.laser.max_range
)
LONGEST = 600.0  # that a robot drives at most [s]
MOVED = 5  # pieces of furniture that went, and that came
_ROOM = 0.7  # what came keeps clear of all else [m]


Part = tuple[float, float, float, float]


@dataclass(frozen=True)
class Mapping:
    """One robot's way through a place; all randomness of it comes from `seed`."""

    place: Environment
    tour: Tour
    seed: int


def mappings(seed: int) -> dict[str, Mapping]:
    """Return what each map is made of, by name."""
    office, other = generate(OFFICE, seed), generate(OTHER, seed + 1)
    later = refurnished(office, seed)[0]
    found = {
        name: Mapping(office, tour(office, part, begin, seed, number), seed * 10 + number)
        for number, (name, (part, begin)) in enumerate(PARTS.items(), 1)
    }
    found["other_building"] = Mapping(other, plan_tours(other, 1, seed, share=0.9)[0], seed * 10 + 4)
    part, _ = PARTS["robot_1"]
    found["robot_1_later"] = Mapping(later, tour(later, part, LATER_START, seed, 5), seed * 10 + 5)
    return found


def tour(place: Environment, part: Part, begin: tuple[float, float], seed: int, number: int) -> Tour:
    """Return a tour of a part of a place, always on to the nearest of the stops that are left."""
    plan = FloorPlan(place)
    whole = plan_tours(place, number, seed, share=1.0, plan=plan)[-1]
    size = np.array(place.size)
    stops = np.array(whole.stops)
    low, high = size * part[:2], size * part[2:]
    stops = stops[((stops >= low) & (stops <= high)).all(axis=1)]
    at, *left = stops[np.argsort(np.hypot(*(stops - size * begin).T))]
    start, order = Pose2(float(at[0]), float(at[1]), whole.start.theta), []
    while left:
        nearest = int(plan.planner.costs(at, left).argmin())
        at = left.pop(nearest)
        order.append((float(at[0]), float(at[1])))
    return Tour(start, tuple(order), ())


def refurnished(office: Environment, seed: int) -> tuple[Environment, list[Furniture], list[Furniture]]:
    """Return the office some months later, what went and what came, all in robot 1's part."""
    rng = np.random.default_rng((seed, 6))
    east = office.size[0] * PARTS["robot_1"][0][2]

    def there(piece: Furniture) -> bool:
        return piece.footprint.x < east and piece.kind is not Kind.CHAIR

    could = [piece for piece in office.furniture if there(piece)]
    went = [could[i] for i in sorted(rng.permutation(len(could))[:MOVED])]
    stays = [piece for piece in office.furniture if piece not in went]
    came: list[Furniture] = []
    for piece in furnish(office, seed + 1000).furniture:
        at = piece.footprint
        near = (
            math.hypot(at.x - box.x, at.y - box.y) - max(at.length, box.length)
            for box in (other.footprint for other in (*stays, *went, *came))
        )
        if len(came) < MOVED and there(piece) and min(near) > _ROOM:
            came.append(piece)
    return replace(office, furniture=(*stays, *came)), went, came


# ---------------------------------------------------------------------- driving and mapping
def scans(mapping: Mapping) -> Iterator[Scan]:
    """Drive, and give the scans with their odometry."""
    world = World(mapping.place, [mapping.tour.start], seed=mapping.seed)
    driver = TourDriver(FloorPlan(mapping.place), mapping.tour.stops, seed=mapping.seed)
    for moment in drive(world, [driver], LONGEST):
        if moment.scan is not None:
            yield moment.scan


def history(mapping: Mapping) -> Iterator[OccupancyGrid]:
    """Give the map of every second in which it changed; its frame's origin is the start pose."""
    for grid in states(GMapping(MECABOT.laser, SLAM, mapping.seed), scans(mapping)):
        yield grid.cropped(margin=5)


# ---------------------------------------------------------------------- files
def truth(seed: int) -> dict[str, object]:
    """Return what ``truth.yaml`` says: starts, T_a_b between the maps of the office, what came and went."""
    found = mappings(seed)
    starts = {name: found[name].tour.start for name in ("robot_1", "robot_2", "robot_3")}
    between = {
        f"T_{a.split('_')[1]}_{b.split('_')[1]}": _numbers(starts[a].inverse() @ starts[b])
        for a, b in combinations(starts, 2)
    }
    T_1_world = starts["robot_1"].inverse()
    _, went, came = refurnished(found["robot_1"].place, seed)

    def centres(pieces: list[Furniture]) -> list[list[float]]:
        places = [T_1_world.apply((piece.footprint.x, piece.footprint.y)) for piece in pieces]
        return [[round(float(v), 3) for v in place] for place in places]

    return {
        "transforms": between,
        "start_poses": {name: _numbers(pose) for name, pose in starts.items()},
        "later": {
            "T_1_later": _numbers(T_1_world @ found["robot_1_later"].tour.start),
            "gone": centres(went),
            "came": centres(came),
        },
    }


def _numbers(pose: Pose2) -> list[float]:
    return [round(float(value), 9) for value in (pose.x, pose.y, pose.theta)]


def write_all(out: Path, seed: int, force: bool) -> None:
    """Let every robot map, and write its map and the truth into the folder `out`."""
    jobs = mappings(seed)
    names = [*jobs, "floor"]
    files = [out / f"{name}.{ending}" for name in names for ending in ("yaml", "pgm")] + [out / "truth.yaml"]
    out.mkdir(parents=True, exist_ok=True)
    check_targets(files, force=force)  # before the work, not after it
    maps = {"floor": true_map(jobs["robot_1"].place)}
    for name, mapping in jobs.items():
        *_, maps[name] = history(mapping)
    for name, grid in maps.items():
        save(grid, out / f"{name}.yaml", force=force)
    text = (
        "# T_a_b takes a point of robot b's map into robot a's: [x m, y m, theta rad].\n"
        "# Start poses are in the frame of floor.yaml; each is the origin of that robot's map.\n"
        "# Later, robot 1 mapped the floor again; of what came and went, middles in its first map.\n"
        + yaml.safe_dump(truth(seed), default_flow_style=None, sort_keys=False)
    )
    write_files([(out / "truth.yaml", [text.encode()])], force=force)


def main(arguments: list[str] | None = None) -> int:
    """Run from the command line; return the exit code."""
    parser = argparse.ArgumentParser(description="Simulate robots that map an office, and write their maps.")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "maps", help="folder to write to")
    parser.add_argument("--seed", type=int, default=SEED, help=f"of all randomness (default {SEED})")
    parser.add_argument("--force", action="store_true", help="overwrite maps that are there")
    options = parser.parse_args(arguments)
    if options.seed < 0:
        parser.error(f"--seed must be 0 or more, not {options.seed}")
    try:
        write_all(options.out, options.seed, options.force)
    except (MapmeldError, OSError) as problem:
        print(f"make_maps: {problem}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
