"""How well changes are told from drift: simulated floors with other furniture, bent on purpose.

    python benchmarks/changes.py

Six pairs of maps by the simulation of `drawn_office.py`: a robot maps the office, and again after
about a quarter of the furniture was carried away and ten new things came. The later map is then bent by a
smooth random displacement of up to 0, 0.2 and 0.4 m (wave lengths of 14 to 30 m on a floor of 20 x 16 m),
matched, and compared with and without local bending.

By area of cells: *precision* is the share of reported cells within 0.3 m of furniture that truly came or
went; *recall* the share of its mapped cells, where the other map had seen floor, within 0.3 m of which
a change of that kind is reported.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import drawn_office
import numpy as np
from numpy.typing import NDArray

from mapmeld.changes import Change, MapDiff, diff
from mapmeld.changes.classes import distance_to
from mapmeld.grid import Mask, OccupancyGrid, resample
from mapmeld.se2 import Pose2

NEAR = 0.3  # [m]
DESIGNS = {
    "rigid, tolerance 0.2 m": {"max_bend": 0.0},
    "rigid, tolerance 0.3 m": {"max_bend": 0.0, "tolerance": 0.3},
    "rigid, tolerance 0.45 m": {"max_bend": 0.0, "tolerance": 0.45},
    "bent locally, tolerance 0.2 m (the default)": {},
}


@dataclass(frozen=True)
class Pair:
    """Two maps of the same start, and the furniture that went and came, as masks on the plan."""

    old: OccupancyGrid
    new: OccupancyGrid
    start: Pose2
    plan: OccupancyGrid
    went: Mask
    came: Mask


def refurnished(rng: np.random.Generator) -> Any:
    """Return the office with some of its furniture gone and ten new things on the free floor."""
    office = drawn_office.OFFICE
    boxes = [item for item in office.boxes if rng.random() < 0.85]
    tables = [item for item in office.tables if rng.random() < 0.7]
    chairs = [item for item in office.chairs if rng.random() < 0.6]
    bare = replace(office, boxes=tuple(boxes), tables=tuple(tables), chairs=tuple(chairs))
    _, blocked = drawn_office.draw(bare)
    room = cv2.distanceTransform((~blocked.occupied).astype(np.uint8), cv2.DIST_L2, 5) * blocked.resolution
    row, col = np.indices(room.shape)

    def place(needed: float) -> tuple[float, float]:
        rows, cols = np.nonzero(room > needed)
        k = rng.integers(len(rows))
        room[np.hypot(row - rows[k], col - cols[k]) * blocked.resolution < needed + 0.8] = 0
        x, y = blocked.lattice_to_metres((cols[k] + 0.5, rows[k] + 0.5))
        return float(x), float(y)

    for _ in range(4):
        boxes.append((*place(0.75), rng.uniform(0.3, 1.0), rng.uniform(0.3, 0.5), rng.uniform(0, 180)))
    for _ in range(2):
        tables.append((*place(0.85), rng.uniform(0.8, 1.2), 0.7, rng.uniform(0, 180)))
    for _ in range(4):
        chairs.append((*place(0.6), rng.uniform(0, 180)))
    return replace(office, boxes=tuple(boxes), tables=tuple(tables), chairs=tuple(chairs))


def simulated(seed: int) -> Pair:
    """Map the office before and after; furniture that bars the robot's way is set up anew."""
    tour = list(drawn_office.TOURS.values())[seed % len(drawn_office.TOURS)]
    before, _ = drawn_office.draw(drawn_office.OFFICE)
    for attempt in range(50):
        later = refurnished(np.random.default_rng((seed, attempt)))
        try:
            new = drawn_office.simulate(later, tour, np.random.default_rng((7, seed)))
        except ValueError:
            continue
        after, _ = drawn_office.draw(later)
        old = drawn_office.simulate(drawn_office.OFFICE, tour, np.random.default_rng((8, seed)))
        went, came = before.occupied & ~after.occupied, after.occupied & ~before.occupied
        return Pair(old, new, tour.start, before, went, came)
    raise SystemExit("no furniture leaves the robot a way")


def bent(grid: OccupancyGrid, amount: float, rng: np.random.Generator) -> OccupancyGrid:
    """Return the map displaced smoothly by up to `amount` [m]."""
    wide = grid.extended(12, 12, 12, 12)
    phase, length, way = (rng.uniform(low, high, (2, 3)) for low, high in ((0, 6.28), (14, 30), (0, 3.14)))

    def wave(col: NDArray[np.floating[Any]], row: NDArray[np.floating[Any]]) -> NDArray[np.complex128]:
        x, y = col * grid.resolution, row * grid.resolution
        parts = [
            sum(
                np.sin(
                    2 * math.pi / length[k, i] * (x * np.cos(way[k, i]) + y * np.sin(way[k, i])) + phase[k, i]
                )
                for i in range(3)
            )
            for k in range(2)
        ]
        return np.asarray(parts[0] + 1j * parts[1])

    rows, cols = np.nonzero(wide.known)
    values = wave(cols + 0.5, rows + 0.5)
    middle = values.mean()
    scale = amount / grid.resolution / float(np.abs(values - middle).max())
    cells = resample(grid, Pose2(), wide, displacement=lambda col, row: scale * (wave(col, row) - middle))
    return replace(wide, cells=cells)


def counted(pair: Pair, found: MapDiff) -> NDArray[np.int64]:
    """Return (reported cells that are right, reported, true cells that are found, true)."""
    lattice = found.old
    undistorted = replace(lattice, cells=resample(pair.new, Pose2(), lattice))
    counts = np.zeros(4, np.int64)
    for change, furniture, own, other in (
        (Change.APPEARED, pair.came, undistorted, lattice),
        (Change.VANISHED, pair.went, lattice, undistorted),
    ):
        away = distance_to(furniture) * pair.plan.resolution

        def on_map(mask: Mask) -> Mask:
            plan = replace(pair.plan, cells=np.where(mask, 100, 0).astype(np.int8))
            return np.asarray(resample(plan, pair.start.inverse(), lattice) == 100)

        reported = found.classes == change
        true = own.occupied & on_map(away <= 0.1) & other.free
        hit = true & (distance_to(reported) * lattice.resolution <= NEAR)
        counts += [
            np.count_nonzero(reported & on_map(away <= NEAR)),
            np.count_nonzero(reported),
            np.count_nonzero(hit),
            np.count_nonzero(true),
        ]
    return counts


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--pairs", type=int, default=6, help="how many pairs (default 6)")
    options = parser.parse_args(arguments)
    pairs = [simulated(seed) for seed in range(options.pairs)]
    print("| | bent by up to | precision | recall | changes |\n|---|---|---|---|---|")
    for name, settings in DESIGNS.items():
        for amount in (0.0, 0.2, 0.4):
            counts, regions = np.zeros(4, np.int64), 0
            for seed, pair in enumerate(pairs):
                later = bent(pair.new, amount, np.random.default_rng(seed)) if amount else pair.new
                found = diff(pair.old, later, **settings)  # type: ignore[arg-type]
                counts += counted(pair, found)
                regions += len(found.regions)
            right, reported, hit, true = counts.tolist()
            print(
                f"| {name} | {amount:g} m | {right / reported:.3f} | {hit / true:.3f} | {regions} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
