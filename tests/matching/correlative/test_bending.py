import math
from dataclasses import replace

import numpy as np
import pytest
from drawing import office
from hypothesis import given
from hypothesis import strategies as st
from ready import rows, walls_of

from mapmeld.grid import UNKNOWN, OccupancyGrid
from mapmeld.matching.correlative.alignment import look_up
from mapmeld.matching.correlative.bending import (
    PATCH,
    nearest_rigid,
    patch_shifts,
    patches_of,
    smooth_bending,
)
from mapmeld.matching.correlative.wall_map import Plane
from mapmeld.se2 import Pose2

GRID = office(0.05)
OFFICE = walls_of(GRID)
IDENTITY = rows(Pose2())


def bent(amount: float) -> OccupancyGrid:
    """The office as a robot with a drifting heading maps it: what lies at z is drawn at z - bend(z)."""
    grid = GRID.extended(20, 20, 20, 20)
    rows_, cols = grid.shape
    col, row = np.meshgrid(np.arange(cols) + 0.5, np.arange(rows_) + 0.5)
    z = grid.lattice_to_metres(np.stack([col, row], axis=-1)) @ [1, 1j]
    there = z + bend(z, amount)
    at = np.floor(GRID.metres_to_lattice(np.stack([there.real, there.imag], axis=-1))).astype(int)
    inside = ((at >= 0) & (at < GRID.shape[::-1])).all(axis=-1)
    cells = np.full(grid.shape, UNKNOWN, np.int8)
    cells[inside] = GRID.cells[at[inside][:, 1], at[inside][:, 0]]
    return OccupancyGrid(cells, grid.resolution, grid.origin)


def bend(z: np.ndarray, amount: float) -> np.ndarray:
    """A bow: up to `amount` metres at the ends of the office, none in its middle."""
    x = (z.real - 8) / 8
    return np.asarray(1j * amount * x * x)


# ---------------------------------------------------------------------- smooth
@pytest.mark.parametrize("amount", [0.2, -0.3])
def test_a_bow_is_straightened(amount: float) -> None:
    b = walls_of(bent(amount))
    t = rows(OFFICE.frame.inverse() @ b.frame)
    x = look_up(OFFICE, b, t, 500).x
    u = smooth_bending(OFFICE, b, t, x)
    wanted = bend(x[0], amount)
    before, after = (float(np.sqrt(np.mean(np.abs(r) ** 2))) for r in (wanted, u[0] - wanted))
    assert before > 0.08
    assert after < 0.4 * before
    # And the walls meet.
    e = np.abs(look_up(OFFICE, b, t, 500, u).across()[0])
    assert np.mean(e < 0.05) > 0.85 > np.mean(np.abs(look_up(OFFICE, b, t, 500).across()[0]) < 0.05)


def test_what_fits_is_not_bent() -> None:
    x = OFFICE.points[None, :400]
    assert np.abs(smooth_bending(OFFICE, OFFICE, IDENTITY, x)).max() < 1e-4


def test_the_bending_is_held_at_the_edge_of_what_is_matched() -> None:
    b = walls_of(bent(0.3))
    t = rows(OFFICE.frame.inverse() @ b.frame)
    far = np.array([[1e3, -1e3, 1e3j, 1e4 + 1e4j]], np.complex64)
    assert np.abs(smooth_bending(OFFICE, b, t, far)).max() < 2


def test_each_transform_gets_its_own_bending() -> None:
    b = walls_of(bent(0.3))
    T = OFFICE.frame.inverse() @ b.frame
    t = rows(T, Pose2(0.1, 0.1, 0.01) @ T)
    x = look_up(OFFICE, b, t, 300).x
    together = smooth_bending(OFFICE, b, t, x)
    for k in range(2):
        alone = smooth_bending(OFFICE, b, t[k : k + 1], x[k : k + 1])
        np.testing.assert_allclose(together[k], alone[0], atol=1e-4)


# ---------------------------------------------------------------------- patches
def test_patches_are_squares_that_no_rows_share() -> None:
    rng = np.random.default_rng(0)
    x = (rng.uniform(-20, 20, (3, 200)) + 1j * rng.uniform(-10, 10, (3, 200))).astype(np.complex64)
    patch, count = patches_of(x)
    assert patch.shape == x.shape
    assert 0 <= patch.min() <= patch.max() < count
    column, line = np.floor(x.real / PATCH), np.floor(x.imag / PATCH)
    places = {(k, c, r): p for k in range(3) for c, r, p in zip(column[k], line[k], patch[k], strict=True)}
    assert len(set(places.values())) == len(places)  # other place or row, other patch
    for k in range(3):
        for c, r, p in zip(column[k], line[k], patch[k], strict=True):
            assert places[k, c, r] == p  # same place, same patch


def test_every_patch_is_shifted_to_where_its_walls_meet() -> None:
    off = np.complex64(0.12 - 0.1j)
    p = look_up(OFFICE, OFFICE, rows(Pose2(float(off.real), float(off.imag), 0)), 2000)
    patch, count = patches_of(p.x)
    shifts = patch_shifts(p, patch, count)
    assert shifts.shape == (count,)
    walls = np.bincount(patch[0], minlength=count)
    assert (shifts[walls == 0] == 0).all()
    # The corner rooms have walls of both directions; the spring keeps a little of it.
    corner = patch[0, np.abs(p.x[0] - (0.1 + 0.1j)).argmin()]
    assert abs(shifts[corner] + off) < 0.25 * abs(off)


# ---------------------------------------------------------------------- back to a rigid motion
angles = st.floats(-0.05, 0.05)
shifts = st.floats(-0.5, 0.5)


def apply(t: np.ndarray, z: Plane) -> np.ndarray:
    return np.asarray(z * np.exp(1j * t[2]) + t[0] + 1j * t[1])


@given(st.from_type(Pose2), shifts, shifts, angles)
def test_a_displacement_that_is_rigid_is_taken_over(T: Pose2, dx: float, dy: float, turn: float) -> None:
    t = rows(T)
    y = OFFICE.points[:300].astype(complex)
    x = apply(t[0], y)
    further = Pose2(T.x + dx, T.y + dy, T.theta + turn)
    u = apply(rows(further)[0], y) - x
    found = nearest_rigid(
        t, x[None].astype(np.complex64), u[None].astype(np.complex64), np.ones((1, 300), np.float32)
    )
    # The angle's sine counts as the angle, and single precision at 100 m is 10 micrometres.
    assert float(np.abs(apply(found[0], y) - apply(rows(further)[0], y)).max()) < 0.02 * abs(turn) + 1e-3


def test_only_weighted_points_count() -> None:
    x = OFFICE.points[None, :200]
    u = np.where(x.real < 5, 0.3, -77).astype(np.complex64)
    found = nearest_rigid(IDENTITY, x, u, (x.real < 5).astype(np.float32))
    np.testing.assert_allclose(found, [[0.3, 0, 0]], atol=1e-4)
    nothing = nearest_rigid(rows(Pose2(1, 2, 3)), x, u, np.zeros(x.shape, np.float32))
    np.testing.assert_allclose(nothing, rows(Pose2(1, 2, 3)), atol=1e-6)


def test_the_nearest_is_the_least_squares_one() -> None:
    rng = np.random.default_rng(1)
    x = OFFICE.points[None, :200]
    noise = rng.normal(0, 0.05, (2, 1, 200))
    u = (noise[0] + 1j * noise[1] + 0.01j * (x - 3)).astype(np.complex64)
    w = rng.random((1, 200)).astype(np.float32)
    best = nearest_rigid(IDENTITY, x, u, w)[0]

    def cost(t: np.ndarray) -> float:
        return float((w[0] * np.abs(apply(t, x[0]) - x[0] - u[0]) ** 2).sum())

    for k in range(3):
        for step in (-0.02, 0.02):
            other = best + step * np.eye(3)[k]
            assert cost(best) < cost(other)
    assert math.isfinite(cost(best))


def test_points_need_no_field() -> None:
    # Bending looks walls up; what it is asked about may lie anywhere.
    elsewhere = replace(OFFICE, points=OFFICE.points + np.complex64(1))
    u = smooth_bending(OFFICE, OFFICE, IDENTITY, elsewhere.points[None])
    assert np.isfinite(u).all()
