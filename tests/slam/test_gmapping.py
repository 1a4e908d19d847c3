"""The whole filter on a small room."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from worlds import LASER, ROOM, drive, pose_rms, ranges_from

from mapmeld.recording import Laser, Scan
from mapmeld.se2 import Pose2, wrap_angle
from mapmeld.slam import (
    GMapping,
    GMappingParameters,
    MapTooLargeError,
    ScanError,
    map_history,
    states,
    write_trajectory,
)
from mapmeld.slam.history import second_of

QUICK = GMappingParameters(particles=6, linearUpdate=0.2, angularUpdate=0.2, delta=0.05)


def mapped(parameters: GMappingParameters = QUICK, seed: int = 0, **kinds: Any) -> tuple[GMapping, Any]:
    scans, true = drive(**kinds)
    slam = GMapping(kinds.get("laser", LASER), parameters, seed)
    used = [slam.add(scan) for scan in scans]
    return slam, (scans, true, np.array(used))


@pytest.mark.parametrize("proposal", ["matched", "sampled"])
def test_the_path_is_truer_than_odometry(proposal: str) -> None:
    parameters: Any = replace(QUICK, proposal=proposal)  # type: ignore[arg-type]
    slam, (scans, true, used) = mapped(parameters)
    believed = np.array([(s.T_odom_base.x, s.T_odom_base.y, s.T_odom_base.theta) for s in scans])
    found = slam.trajectory()
    assert len(found.stamps) == used.sum() < len(scans)
    np.testing.assert_array_equal(found.stamps, np.array([s.stamp for s in scans])[used])
    by_odometry, by_slam = pose_rms(believed[used], true[used]), pose_rms(found.poses, true[used])
    assert by_odometry > 0.2
    assert by_slam < 0.05
    assert by_slam < by_odometry / 4


def test_walls_of_the_map_lie_on_the_walls() -> None:
    slam, (_, true, _) = mapped()
    grid = slam.map()
    start = slam.trajectory().poses[0]
    T_world_map = Pose2(*true[0]) @ Pose2(*start).inverse()
    points = T_world_map.apply(grid.centres(grid.occupied))
    off = np.full(len(points), np.inf)
    for x0, y0, x1, y1 in ROOM:
        a, along = np.array([x0, y0]), np.array([x1 - x0, y1 - y0])
        share = np.clip((points - a) @ along / (along @ along), 0, 1)
        off = np.minimum(off, np.hypot(*(points - a - share[:, None] * along).T))
    assert np.quantile(off, 0.95) < 0.12
    assert grid.free.sum() * 0.05**2 == pytest.approx(6 * 4 - 2 * 0.8 - 0.75 - 0.2, rel=0.1)


def test_the_same_seed_gives_the_same_map_and_another_one_another() -> None:
    first, _ = mapped(seed=3, steps=60)
    again, _ = mapped(seed=3, steps=60)
    other, _ = mapped(seed=4, steps=60)
    assert first.map() == again.map()
    np.testing.assert_array_equal(first.trajectory().poses, again.trajectory().poses)
    assert not np.array_equal(first.trajectory().poses, other.trajectory().poses)


def test_where_the_laser_sits_does_not_matter() -> None:
    mount = Pose2(0.15, -0.05, math.radians(30))
    laser = replace(LASER, first_angle=LASER.first_angle - mount.theta, T_base_laser=mount)
    slam, (_, true, used) = mapped(laser=laser)
    assert pose_rms(slam.trajectory().poses, true[used]) < 0.05


def test_a_laser_that_counts_clockwise_gives_the_same_map() -> None:
    scans, _ = drive(steps=30)
    turned = Laser(LASER.beams, -LASER.first_angle, -LASER.step, LASER.max_range)
    plain, other = GMapping(LASER, QUICK), GMapping(turned, QUICK)
    for scan in scans:
        plain.add(scan)
        other.add(replace(scan, ranges=scan.ranges[::-1].copy()))
    known = plain.map().known & other.map().known if plain.map().shape == other.map().shape else None
    assert known is not None
    assert np.mean(plain.map().cells == other.map().cells) > 0.98


def test_scans_are_used_after_way_turn_or_time() -> None:
    def used(poses: list[Pose2], **settings: Any) -> list[bool]:
        p = replace(QUICK, linearUpdate=1.0, angularUpdate=0.5, **settings)
        slam = GMapping(LASER, p)
        ranges = ranges_from(Pose2(3, 1, 0)).astype(np.float32)
        return [slam.add(Scan(float(n), pose, ranges)) for n, pose in enumerate(poses)]

    way = [Pose2(0.3 * n, 0.0, 0.0) for n in range(6)]
    assert used(way) == [True, False, False, False, True, False]
    turn = [Pose2(0.0, 0.0, 0.2 * n) for n in range(5)]
    assert used(turn) == [True, False, False, True, False]
    assert used([Pose2()] * 4) == [True, False, False, False]
    assert used([Pose2()] * 5, temporalUpdate=1.5) == [True, False, True, False, True]


def test_the_map_begins_where_odometry_does() -> None:
    start = Pose2(10.0, -5.0, 2.0)
    slam = GMapping(LASER, QUICK)
    assert slam.pose == Pose2()
    slam.add(Scan(0.0, start, ranges_from(Pose2(3, 1, 0)).astype(np.float32)))
    assert slam.pose.distance_to(start) == pytest.approx((0, 0), abs=1e-9)
    assert slam.T_map_odom.distance_to(Pose2()) == pytest.approx((0, 0), abs=1e-9)
    col, row = np.floor(slam.map().metres_to_lattice((start.x, start.y))).astype(int)
    assert slam.map().free[row, col]


def test_the_pose_follows_odometry_between_the_scans_that_are_used() -> None:
    slam, _ = mapped(steps=20)
    last = slam.pose
    odometry = slam.T_map_odom.inverse() @ last
    step = Pose2(0.05, 0.0, 0.01)
    assert not slam.add(Scan(99.0, odometry @ step, np.ones(LASER.beams, np.float32)))
    assert slam.pose.distance_to(last @ step) == pytest.approx((0, 0), abs=1e-9)


def test_beams_are_cut_and_left_out_as_the_ranges_say() -> None:
    laser = Laser(4, 0.0, math.pi / 2, 10.0)
    ranges = np.array([2.02, 5.0, np.inf, np.nan], np.float32)

    def known(**settings: Any) -> list[int]:
        """How many cells are free ahead, to the left, behind, to the right; negative if one is occupied."""
        slam = GMapping(laser, GMappingParameters(particles=2, delta=0.1, **settings))
        slam.add(Scan(0.0, Pose2(0.05, 0.05, 0.0), ranges))
        grid = slam.map()
        col, row = np.floor(grid.metres_to_lattice((0.05, 0.05))).astype(int)
        arms = [
            grid.cells[row, col + 1 :], grid.cells[row + 1 :, col],
            grid.cells[row, :col], grid.cells[:row, col],
        ]  # fmt: skip
        return [-int((a == 0).sum()) if (a == 100).any() else int((a == 0).sum()) for a in arms]

    assert known() == [-19, -49, 0, 0]
    assert known(maxUrange=3.0) == [-19, 29, 0, 0]
    assert known(maxUrange=3.0, maxRange=4.0) == [-19, 0, 0, 0]
    assert known(maxUrange=3.0, maxRange=math.inf) == [-19, 29, 29, 0]


def test_the_path_of_a_particle_is_whole_across_resampling() -> None:
    shared, (_, true, used) = mapped(replace(QUICK, resampleThreshold=1.0, particles=8))
    assert any((np.asarray(parents) != np.arange(8)).any() for parents in shared._parents)
    steps = np.hypot(*np.diff(shared.trajectory().poses[:, :2], axis=0).T)
    true_steps = np.hypot(*np.diff(true[used][:, :2], axis=0).T)
    np.testing.assert_allclose(steps, true_steps, atol=0.1)


def test_scans_in_which_nothing_was_met_do_not_stop_it() -> None:
    slam = GMapping(LASER, QUICK)
    nothing = np.full(LASER.beams, np.inf, np.float32)
    assert slam.add(Scan(0.0, Pose2(), nothing))
    before = slam.has_map
    assert not before
    with pytest.raises(ValueError, match="nothing was entered"):
        slam.map()
    for number in range(1, 4):
        assert slam.add(Scan(float(number), Pose2(0.5 * number, 0.0, 0.0), nothing))
    ranges = ranges_from(Pose2(3, 1, 0)).astype(np.float32)
    assert slam.add(Scan(4.0, Pose2(2.0, 0.0, 0.0), ranges))
    assert slam.has_map
    assert len(slam.trajectory().stamps) == 5


@pytest.mark.parametrize(
    ("scan", "problem"),
    [
        (Scan(1.0, Pose2(), np.ones(7, np.float32)), "has 7 ranges; the laser has 121 beams"),
        (Scan(1.0, Pose2(math.nan), np.ones(121, np.float32)), "no finite odometry"),
        (Scan(math.inf, Pose2(), np.ones(121, np.float32)), "no finite odometry"),
    ],
)
def test_scans_that_cannot_be_are_refused(scan: Scan, problem: str) -> None:
    with pytest.raises(ScanError, match=problem):
        GMapping(LASER, QUICK).add(scan)


def test_odometry_that_jumps_out_of_the_world_is_refused() -> None:
    slam = GMapping(LASER, QUICK)
    ranges = ranges_from(Pose2(3, 1, 0)).astype(np.float32)
    slam.add(Scan(0.0, Pose2(), ranges))
    with pytest.raises(MapTooLargeError, match="the odometry jumps"):
        slam.add(Scan(1.0, Pose2(1e9, 0.0, 0.0), ranges))


def test_odometry_that_begins_far_away_needs_the_map_to_be_there() -> None:
    scan = Scan(0.0, Pose2(5e5, 5e6), np.full(LASER.beams, 2.0, np.float32))
    with pytest.raises(MapTooLargeError, match="set xmin, ymin, xmax and ymax"):
        GMapping(LASER, QUICK).add(scan)
    there = replace(QUICK, xmin=499_990.0, ymin=4_999_990.0, xmax=500_010.0, ymax=5_000_010.0)
    slam = GMapping(LASER, there)
    assert slam.add(scan)
    assert slam.map().origin.x == pytest.approx(5e5, abs=5.0)


@pytest.mark.parametrize("proposal", ["matched", "sampled"])
def test_more_than_half_a_turn_between_two_scans(proposal: Any) -> None:
    parameters = replace(QUICK, proposal=proposal, linearUpdate=100.0, angularUpdate=4.0, stt=0.02, srt=0.02)
    slam, (_, true, used) = mapped(parameters)
    found = slam.trajectory().poses
    assert len(found) == 2
    turned = (true[used][1] - true[used][0])[2]
    assert turned > math.pi
    assert abs(wrap_angle(found[1, 2] - found[0, 2] - turned)) < 0.15
    # A whole turn away, the motion would be as good as impossible.
    assert slam._totals.max() > -800


# ---------------------------------------------------------------- history
def test_the_history_has_a_state_per_second_in_which_the_map_changed() -> None:
    scans, _ = drive(steps=60)  # 6 s
    slam = GMapping(LASER, QUICK)
    found = list(states(slam, scans))
    stamps = [grid.stamp for grid in found]
    changes = slam.trajectory().stamps
    # The last change in each second.
    expected = [
        max(s for s in changes if math.floor(s) == n) for n in sorted({math.floor(s) for s in changes})
    ]
    assert stamps == pytest.approx(expected)
    assert found[-1] == slam.map()
    areas = [grid.known_area for grid in found]
    assert areas[0] < areas[-1]
    assert list(map_history(LASER, scans, QUICK)) == found


def test_seconds_without_a_change_have_no_state() -> None:
    ranges = ranges_from(Pose2(3, 1, 0)).astype(np.float32)
    poses = [Pose2()] * 5 + [Pose2(0.5, 0.0, 0.0)] * 5
    scans = [Scan(100 + 1.1 * n, pose, ranges) for n, pose in enumerate(poses)]
    assert [grid.stamp for grid in map_history(LASER, scans, QUICK)] == pytest.approx([100.0, 105.5])
    assert [g.stamp for g in map_history(LASER, scans, QUICK, every=1000.0)] == pytest.approx([105.5])
    assert list(map_history(LASER, [], QUICK)) == []
    with pytest.raises(ValueError, match="every must be more than 0"):
        list(map_history(LASER, scans, QUICK, every=0.0))


def test_the_trajectory_is_written_as_evo_reads_it(tmp_path: Any) -> None:
    slam, (_, _, used) = mapped(steps=40)
    write_trajectory(slam.trajectory(), tmp_path / "t.txt")
    rows = np.loadtxt(tmp_path / "t.txt")
    found = slam.trajectory()
    assert rows.shape == (used.sum(), 8)
    np.testing.assert_allclose(rows[:, :3], np.column_stack([found.stamps, found.poses[:, :2]]), atol=1e-6)
    np.testing.assert_allclose(2 * np.arctan2(rows[:, 6], rows[:, 7]), found.poses[:, 2], atol=1e-6)
    assert not rows[:, 3:6].any()


@pytest.mark.parametrize("start", [0.0, 1700000000.1, 1700000000.7])
def test_seconds_do_not_lose_states_to_rounding(start: float) -> None:
    # Scans at 10 Hz: every tenth begins a second, however its stamp is rounded.
    for every, per_second in ((1.0, 10), (0.1, 1), (0.5, 5)):
        seconds = [second_of(start + n / 10, start, every) for n in range(500)]
        assert seconds == [n // per_second for n in range(500)]
