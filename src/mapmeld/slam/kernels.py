"""The inner loops: a scan against the maps of all particles, and into one of them.

All in one file, as `mapmeld.slam.compiled` asks for. Lengths are in cells, and positions in lattice
coordinates of the tables of patches: (0, 0) is the lower left corner of their first patch. What
`cells` and `walls` hold is said in `mapmeld.slam.shared_maps`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapmeld.slam.compiled import compiled
from mapmeld.slam.interruptible import interruptible

Floats = NDArray[np.float64]
Cells = NDArray[np.float32]
Bits = NDArray[np.int64]
Ids = NDArray[np.int32]

PATCH_BITS = 5
PATCH = 1 << PATCH_BITS
"""Side of a patch [cells]; a row of it fits into half a word of `walls`."""

_LOW = PATCH - 1

FULLNESS = 0.1
"""From which share of hits on a cell is wall to the scan matching: GMapping's constant."""


class Sensor(NamedTuple):
    """How a beam is weighed by the squared distance d^2 [cells^2] from its end to the nearest wall.

    Attributes
    ----------
    kernel
        How far around the end walls are looked for, to every side.
    score_gain
        The score of a beam is exp(-score_gain d^2), 0 without a wall.
    likelihood_gain
        Its log-likelihood is -likelihood_gain d^2.
    missed
        Its log-likelihood without a wall.
    """

    kernel: int
    score_gain: float
    likelihood_gain: float
    missed: float


@compiled
def _window(walls: Bits, table: Ids, row: int, col: int) -> int:
    """Return which of the cells from `col` to the right are wall: cell `col` is the lowest bit."""
    here: int = walls[table[row >> PATCH_BITS, col >> PATCH_BITS], row & _LOW]
    beside: int = walls[table[row >> PATCH_BITS, (col >> PATCH_BITS) + 1], row & _LOW]
    return (here | (beside << PATCH)) >> (col & _LOW)


@compiled
def evaluate(
    cells: Cells,
    walls: Bits,
    table: Ids,
    x: float,
    y: float,
    theta: float,
    ends: Floats,
    sensor: Sensor,
    enough: float,
) -> tuple[float, float]:
    """Return how well a scan fits a map at a pose: (score, log-likelihood).

    Every beam looks for the nearest wall around its end: the mean point of the hits in a cell that is wall.

    Parameters
    ----------
    cells, walls, table
        The patches, and which of them the map has where.
    x, y, theta
        The robot's pose.
    ends
        (n, 2) ends of the beams in the robot's frame.
    enough
        The evaluation is given up, with a score of no more than this, as soon as the score
        cannot exceed it any more.
    """
    rows, cols = table.shape
    reach = sensor.kernel
    # Beyond these a window, which takes in the patch beside, would leave the table.
    bottom, top = reach, (rows << PATCH_BITS) - reach
    left, right = reach, ((cols - 1) << PATCH_BITS) - reach
    mask = (1 << (2 * reach + 1)) - 1
    c, s = math.cos(theta), math.sin(theta)
    score = 0.0
    likelihood = 0.0
    for k in range(ends.shape[0]):
        end_x = x + c * ends[k, 0] - s * ends[k, 1]
        end_y = y + s * ends[k, 0] + c * ends[k, 1]
        col, row = math.floor(end_x), math.floor(end_y)
        nearest = np.inf
        if bottom <= row < top and left <= col < right:
            for r in range(row - reach, row + reach + 1):
                q = col - reach
                found = _window(walls, table, r, q) & mask
                while found:
                    if found & 1:
                        patch = table[r >> PATCH_BITS, q >> PATCH_BITS]
                        at = ((r & _LOW) << PATCH_BITS) | (q & _LOW)
                        dx = end_x - q - cells[patch, at, 0]
                        dy = end_y - r - cells[patch, at, 1]
                        nearest = min(nearest, dx * dx + dy * dy)
                    found >>= 1
                    q += 1
        if nearest < np.inf:
            score += math.exp(-sensor.score_gain * nearest)
            likelihood -= sensor.likelihood_gain * nearest
        else:
            likelihood += sensor.missed
        if score + (ends.shape[0] - 1 - k) <= enough:
            break
    return score, likelihood


@interruptible
@compiled
def climb(
    cells: Cells,
    walls: Bits,
    tables: Ids,
    poses: Floats,
    ends: Floats,
    sensor: Sensor,
    step: float,
    turn: float,
    halvings: int,
) -> tuple[Floats, Floats]:
    """Move every particle, in place, to where the scan fits its map best: (scores, log-likelihoods).

    Hill climbing: of six moves (along both axes by `step`, turning by `turn`) the best one, as long as
    one is better; then the moves are halved, `halvings` times.
    """
    scores = np.empty(poses.shape[0])
    likelihoods = np.empty(poses.shape[0])
    for n in range(poses.shape[0]):
        table = tables[n]
        x, y, theta = poses[n, 0], poses[n, 1], poses[n, 2]
        score, likelihood = evaluate(cells, walls, table, x, y, theta, ends, sensor, -1.0)
        along, about = step, turn
        halved = 0
        undo = -1
        while True:
            best = -1
            best_x, best_y, best_theta = x, y, theta
            for move in range(6):
                if move == undo:  # back to where the last move came from
                    continue
                way = 1.0 - 2.0 * (move & 1)
                there_x = x + way * along if move >> 1 == 0 else x
                there_y = y + way * along if move >> 1 == 1 else y
                there_theta = theta + way * about if move >> 1 == 2 else theta
                found = evaluate(cells, walls, table, there_x, there_y, there_theta, ends, sensor, score)
                if found[0] > score:
                    score, likelihood = found
                    best, best_x, best_y, best_theta = move, there_x, there_y, there_theta
            x, y, theta = best_x, best_y, best_theta
            undo = best ^ 1 if best >= 0 else -1
            if best < 0:
                if halved == halvings:
                    break
                halved += 1
                along /= 2
                about /= 2
        poses[n, 0], poses[n, 1], poses[n, 2] = x, y, theta
        scores[n], likelihoods[n] = score, likelihood
    return scores, likelihoods


@interruptible
@compiled
def likelihoods_around(
    cells: Cells, walls: Bits, table: Ids, poses: Floats, ends: Floats, sensor: Sensor
) -> Floats:
    """Return the log-likelihood (n,) of a scan at each pose (n, 3) on one map."""
    found = np.empty(poses.shape[0])
    for n in range(poses.shape[0]):
        found[n] = evaluate(cells, walls, table, poses[n, 0], poses[n, 1], poses[n, 2], ends, sensor, -1.0)[1]
    return found


@interruptible
@compiled
def register(
    cells: Cells,
    walls: Bits,
    references: Ids,
    spare: Ids,
    spares: int,
    table: Ids,
    x: float,
    y: float,
    theta: float,
    start_x: float,
    start_y: float,
    ends: Floats,
    hits: NDArray[np.bool_],
) -> int:
    """Enter a scan into one map, in place; return how many spare patches are left.

    Every beam counts as a visit in each cell on Bresenham's line from the laser to its end, and as a
    hit where it ends. A patch that other maps share, or that does not exist yet, is replaced by a
    copy of its own before it is changed.

    Parameters
    ----------
    references, spare, spares
        Maps per patch; patches that nobody uses, of which the first `spares` count.
    start_x, start_y
        The laser in the robot's frame.
    ends, hits
        (n, 2) ends of the beams in the robot's frame; whether there was a wall.
    """
    c, s = math.cos(theta), math.sin(theta)
    first_col = math.floor(x + c * start_x - s * start_y)
    first_row = math.floor(y + s * start_x + c * start_y)
    for k in range(ends.shape[0]):
        end_x = x + c * ends[k, 0] - s * ends[k, 1]
        end_y = y + s * ends[k, 0] + c * ends[k, 1]
        last_col, last_row = math.floor(end_x), math.floor(end_y)
        col, row = first_col, first_row
        cols, rows = abs(last_col - col), abs(last_row - row)
        right, up = 1 if last_col > col else -1, 1 if last_row > row else -1
        error = cols - rows
        while True:
            last = row == last_row and col == last_col
            if last and not hits[k]:
                break
            patch = table[row >> PATCH_BITS, col >> PATCH_BITS]
            if patch == 0 or references[patch] > 1:
                spares -= 1
                own = spare[spares]
                cells[own] = cells[patch]
                walls[own] = walls[patch]
                references[own] = 1
                if patch:
                    references[patch] -= 1
                table[row >> PATCH_BITS, col >> PATCH_BITS] = own
                patch = own
            cell = cells[patch, ((row & _LOW) << PATCH_BITS) | (col & _LOW)]
            cell[3] += 1
            if last:
                cell[2] += 1
                cell[0] += (end_x - col - cell[0]) / cell[2]
                cell[1] += (end_y - row - cell[1]) / cell[2]
            if cell[2] > 0:
                if cell[2] > FULLNESS * cell[3]:
                    walls[patch, row & _LOW] |= 1 << (col & _LOW)
                else:
                    walls[patch, row & _LOW] &= ~(1 << (col & _LOW))
            if last:
                break
            twice = 2 * error
            if twice >= -rows:
                error -= rows
                col += right
            if twice <= cols:
                error += cols
                row += up
    return spares
