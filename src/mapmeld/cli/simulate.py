"""``mapmeld simulate [ENV] -o RUN.mcap``, or live: ``mapmeld simulate [ENV] --ros``."""

from __future__ import annotations

import math
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from enum import StrEnum
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Annotated

import typer

from mapmeld.cli.options import Force
from mapmeld.cli.simulation_options import (
    ConfigFile,
    Door,
    EnvironmentFile,
    ExtraDoors,
    FurnitureDensity,
    Seed,
    Size,
    Wall,
)
from mapmeld.wording import plural

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from mapmeld.ros.simulated import LiveRobots
    from mapmeld.se2 import Pose2
    from mapmeld.simulation import CommandedDriver, Driver, Environment, FloorPlan, Mapper, Robot
    from mapmeld.simulation.pictures import Drive
    from mapmeld.simulation.recording_file import RecordingWriter
    from mapmeld.simulation.slam_mapper import SlamMapper


class Drives(StrEnum):
    """Who drives."""

    TOUR = "tour"
    FRONTIER = "frontier"
    ROUTE = "route"
    KEYBOARD = "keyboard"
    CMD_VEL = "cmd_vel"


def simulate(
    file: EnvironmentFile = None,
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", metavar="MCAP", help="The recording to write; needed without --ros."),
    ] = None,
    ros: Annotated[
        bool,
        typer.Option(
            "--ros",
            help="Live on ROS 2, until Ctrl-C: scans, odometry, transforms and /clock go out, and who "
            "publishes on a robot's cmd_vel drives it from then on.",
        ),
    ] = False,
    speed: Annotated[
        float | None,
        typer.Option(metavar="X", min=0.1, max=100.0, help="With --ros: times as fast as real time. [1]"),
    ] = None,
    drive: Annotated[
        Drives | None,
        typer.Option(
            "--drive",
            help="A tour of chosen rooms, exploration of frontiers, a recorded route, the keys of "
            "teleop_twist_keyboard, or ROS's cmd_vel alone. [tour; with --ros: cmd_vel]",
        ),
    ] = None,
    seed: Seed = 0,
    mapping: Annotated[
        int,
        typer.Option(
            metavar="K",
            min=1,
            max=1000,
            help="Which mapping of this environment: each starts and drives elsewhere, in part the same.",
        ),
    ] = 1,
    robots: Annotated[
        int, typer.Option(metavar="N", min=1, max=20, help="Robots at once, of mappings K, K + 1, ...")
    ] = 1,
    route: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Lines 'x y' or 't v w', or a recording of one robot."),
    ] = None,
    start: Annotated[
        str | None, typer.Option(metavar="X,Y,DEG", help="Where the robot starts: metres, degrees.")
    ] = None,
    slam: Annotated[
        bool,
        typer.Option(
            "--slam",
            help="Each robot maps on the way (GMapping): /map and its frame; --drive frontier uses it.",
        ),
    ] = False,
    slam_params: Annotated[
        Path | None,
        typer.Option("--slam-params", metavar="FILE", help="YAML file with parameters of slam_gmapping."),
    ] = None,
    duration: Annotated[
        float | None,
        typer.Option(
            metavar="S",
            min=0.1,
            max=36000.0,
            help="Stop after so many seconds at the latest. [900; with --ros: 36000]",
        ),
    ] = None,
    config: ConfigFile = None,
    size: Size = None,
    extra_doors: ExtraDoors = None,
    furniture: FurnitureDensity = 1.0,
    wall: Wall = 0.1,
    door: Door = 0.9,
    picture: Annotated[
        Path | None, typer.Option(metavar="PNG", help="Draw the ways on the floor plan.")
    ] = None,
    force: Force = False,
) -> None:
    """Drive robots with a laser through an environment and record scans, odometry and transforms.

    The recording (MCAP, ROS 2 messages) opens in Foxglove and with rosbag2; /ground_truth has the true poses.
    With --ros the same topics are live.
    """
    from mapmeld.cli.simulation_options import described, wanted_environment
    from mapmeld.cli.tables import print_lines
    from mapmeld.io.atomic import check_targets
    from mapmeld.report import check_picture_path, write_picture
    from mapmeld.simulation import CommandedDriver, FloorPlan, SimulationError, World, plan_tours
    from mapmeld.simulation.driving import drive as driven
    from mapmeld.simulation.pictures import Drive, drive_picture
    from mapmeld.simulation.recording_file import recording_to

    if out is not None:
        if out.suffix.lower() != ".mcap":
            raise SimulationError(f"{out}: recordings are written as MCAP; choose a name that ends in .mcap")
        check_targets([out], force=force)
    elif not ros:
        raise typer.BadParameter("a recording to write is needed, or --ros", param_hint="--out")
    if picture is not None:
        check_picture_path(picture, force=force)
    drive = drive or (Drives.CMD_VEL if ros else Drives.TOUR)
    duration = duration or (36000.0 if ros else 900.0)
    if ros and drive is Drives.KEYBOARD:
        raise typer.BadParameter(
            "with --ros the keys are those of teleop_twist_keyboard", param_hint="--drive"
        )
    if not ros and drive is Drives.CMD_VEL:
        raise typer.BadParameter("cmd_vel is for --ros", param_hint="--drive")
    if speed is not None and not ros:
        raise typer.BadParameter("is for --ros", param_hint="--speed")
    if (drive is Drives.ROUTE) != (route is not None):
        raise typer.BadParameter("goes with --drive route, and that needs it", param_hint="--route")
    if robots > 1 and (drive in (Drives.ROUTE, Drives.KEYBOARD) or start is not None):
        raise typer.BadParameter(
            "more than one goes on tours, frontiers and by cmd_vel only", param_hint="--robots"
        )
    if slam_params is not None and not slam:
        raise typer.BadParameter("is for --slam", param_hint="--slam-params")
    given = None if start is None else _read_start(start)
    mappers = _mappers(robots, seed * 1000 + mapping, slam_params) if slam else []
    made, _ = wanted_environment(file, seed, config, size, extra_doors, furniture, wall, door)
    plan = FloorPlan(made)
    tours = plan_tours(made, mapping + robots - 1, seed, plan=plan)[mapping - 1 :]
    starts = [given or tour.start for tour in tours]
    with ExitStack() as stack:
        watch: Callable[[float, Pose2], bool] = _no_watching
        if drive is Drives.ROUTE:
            assert route is not None
            drivers, first = _on_route(route, plan, mapping)
            starts = [given or first or starts[0]]
        elif drive is Drives.KEYBOARD:
            drivers, watch = _at_keyboard(made, stack)
        elif drive is Drives.CMD_VEL:
            drivers = [CommandedDriver() for _ in starts]
        else:
            drivers = _on_their_own(drive, made, plan, [tour.stops for tour in tours], mapping, mappers)
        if slam and drive is not Drives.FRONTIER:  # who explores feeds the map that it explores with
            from mapmeld.simulation.slam_mapper import MappingDriver

            drivers = [MappingDriver(*pair) for pair in zip(drivers, mappers, strict=True)]
        # Another mapping of a place has other noise, but the place stays as it is.
        world = World(made, starts, seed=seed * 1000 + mapping - 1)
        sinks: list[RecordingWriter | LiveRobots] = []
        if out is not None:
            recording = stack.enter_context(recording_to(out, world.build, robots, force=force))
            sinks.append(recording)
        if ros:
            commanded = [CommandedDriver(driver) for driver in drivers]
            drivers = list(commanded)
            live, watch = _on_ros(commanded, world.build, speed or 1.0, stack)
            sinks.append(live)
        ways = [Drive([], []) for _ in starts]
        begun = time.process_time()
        shown = stack.enter_context(_progress(duration, drive))
        for moment in driven(world, drivers, duration):
            go_on = watch(moment.stamp, moment.T_world_base)
            mapper = mappers[moment.robot] if slam else None
            for sink in sinks:
                sink.add(moment)
                if mapper is not None:
                    sink.add_map_frame(moment.robot, moment.stamp, mapper.slam.T_map_odom)
            if mapper is not None:
                _tell_state(sinks, moment.robot, moment.stamp, mapper)
            if out is not None or picture is not None:  # what is only live may go on for days
                ways[moment.robot].true.append(moment.T_world_base)
                ways[moment.robot].believed.append(moment.T_odom_base)
            shown(moment.stamp)
            if not go_on and moment.robot == robots - 1:
                break
        for robot, mapper in enumerate(mappers):
            mapper.finish()
            _tell_state(sinks, robot, world.time, mapper)
        seconds = time.process_time() - begun
    if out is None and picture is None:
        print_lines(f"Simulated {world.time:.1f} s in {seconds:.1f} s of computing")
        return
    lines = [_summary(way) for way in ways]
    names = [f"Robot {i + 1} drove" for i in range(robots)] if robots > 1 else ["Drove"]
    said = [f"{name} {line}" for name, line in zip(names, lines, strict=True)]
    if picture is not None:
        write_picture(drive_picture(made, ways, " ".join(said)), picture, force=force)
    counts = ""
    if out is not None:
        maps = f", {plural(recording.maps, 'map')}" if slam else ""
        counts = f" ({plural(recording.scans, 'scan')}{maps})"
    print_lines(
        f"Environment: {described(made)}",
        *said,
        f"Simulated {world.time:.1f} s in {seconds:.1f} s of computing",
        f"Written: {', '.join(str(path) for path in (out, picture) if path)}{counts}",
    )


def _no_watching(stamp: float, pose: Pose2) -> bool:
    return True


def _read_start(text: str) -> Pose2:
    from mapmeld.se2 import Pose2

    try:
        x, y, degrees = (float(part) for part in text.split(","))
        if not all(map(math.isfinite, (x, y, degrees))):
            raise ValueError
    except ValueError:
        raise typer.BadParameter(
            f"three numbers x,y,degrees are needed, not {text!r}", param_hint="--start"
        ) from None
    return Pose2(x, y, math.radians(degrees))


def _on_their_own(
    drive: Drives,
    environment: Environment,
    plan: FloorPlan,
    stops: Sequence[tuple[tuple[float, float], ...]],
    seed: int,
    mappers: Sequence[SlamMapper],
) -> list[Driver]:
    from mapmeld.simulation import MECABOT, FrontierDriver, KnownPoseMapper, TourDriver

    if drive is Drives.TOUR:
        return [TourDriver(plan, places, seed=seed + i) for i, places in enumerate(stops)]
    on_board: Sequence[Mapper] = mappers or [KnownPoseMapper(environment.size, MECABOT.laser) for _ in stops]
    return [FrontierDriver(mapper, seed=seed + i) for i, mapper in enumerate(on_board)]


def _mappers(robots: int, seed: int, params: Path | None) -> list[SlamMapper]:
    """Return a mapper for each robot, its code compiled."""
    from dataclasses import asdict

    from mapmeld.cli.errors import say
    from mapmeld.cli.parameters import ParametersError
    from mapmeld.cli.progress import working
    from mapmeld.extras import required
    from mapmeld.simulation import MECABOT

    required("numba", "sim")
    from mapmeld.simulation.slam_mapper import SlamMapper, onboard_parameters
    from mapmeld.slam import GMappingParameters, prepare, read_parameters

    parameters = onboard_parameters(MECABOT.laser)
    if params is not None:
        found = read_parameters(params)
        if found.passed_over:
            say(f"note: {params}: of the ROS node alone, and not used: {', '.join(found.passed_over)}")
        try:
            parameters = GMappingParameters(**{**asdict(parameters), **found.settings})
        except ValueError as error:
            raise ParametersError(f"{params}: {error}") from error
    with working("Getting ready (the first time, code has to be compiled)"):
        prepare()
    return [SlamMapper(MECABOT.laser, parameters, seed + robot) for robot in range(robots)]


def _tell_state(
    sinks: Sequence[RecordingWriter | LiveRobots], robot: int, stamp: float, mapper: SlamMapper
) -> None:
    state = mapper.take_state()
    if state is not None:
        for sink in sinks:
            sink.add_map(robot, stamp, state)


def _on_route(path: Path, plan: FloorPlan, seed: int) -> tuple[list[Driver], Pose2 | None]:
    """Return the driver of a recorded route, and where it set out if the file says so."""
    from mapmeld.se2 import Pose2
    from mapmeld.simulation import CommandLogDriver, TourDriver, read_route
    from mapmeld.simulation.recording_file import read_drive

    if path.suffix.lower() == ".mcap":
        start, commands = read_drive(path)
        return [CommandLogDriver(commands)], start
    route = read_route(path)
    if route.commands:
        return [CommandLogDriver(route.commands)], None
    first, *others = route.waypoints
    ahead = math.atan2(others[0][1] - first[1], others[0][0] - first[0]) if others else 0.0
    return [TourDriver(plan, tuple(others), seed=seed)], Pose2(*first, ahead)


def _at_keyboard(
    environment: Environment, stack: ExitStack
) -> tuple[list[Driver], Callable[[float, Pose2], bool]]:
    from mapmeld.cli.terminal import Clock, Screen, single_keys
    from mapmeld.simulation import KeyboardDriver, true_map
    from mapmeld.simulation.keyboard import HELP

    keys = stack.enter_context(single_keys())
    driver = KeyboardDriver(keys.pressed)
    screen, clock = Screen(true_map(environment), HELP), Clock()

    def watch(stamp: float, pose: Pose2) -> bool:
        screen.show(pose, f"{stamp:6.1f} s   speed {driver.speed:.2f} m/s   turn {driver.turn:.2f} rad/s")
        clock.wait_until(stamp)
        return True

    return [driver], watch


def _on_ros(
    drivers: Sequence[CommandedDriver], build: Robot, speed: float, stack: ExitStack
) -> tuple[LiveRobots, Callable[[float, Pose2], bool]]:
    """Return what publishes, and what keeps time and says whether to go on."""
    from mapmeld.cli.terminal import Clock
    from mapmeld.ros.simulated import live_robots

    ended = stack.enter_context(_asked_to_end())
    live = stack.enter_context(live_robots(build, len(drivers), lambda i, v, w: drivers[i].tell(v, w)))
    clock = Clock()

    def watch(stamp: float, pose: Pose2) -> bool:
        clock.wait_until(stamp / speed)
        return not ended.is_set()

    return live, watch


@contextmanager
def _asked_to_end() -> Iterator[Event]:
    """Give what is set by Ctrl-C and SIGTERM while the block runs: a recording is finished all the same."""
    ended = Event()
    before = {
        number: signal.signal(number, lambda *_: ended.set()) for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield ended
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _summary(way: Drive) -> str:
    """Return how far a robot drove and how far off odometry was at the end."""
    metres = sum(a.distance_to(b)[0] for a, b in zip(way.true, way.true[1:], strict=False))
    true = way.true[0].inverse() @ way.true[-1]
    off, turned = true.distance_to(way.believed[0].inverse() @ way.believed[-1])
    share = f" ({100 * off / metres:.1f} %)" if metres >= 1 else ""
    return (
        f"{metres:.1f} m; odometry is {off:.2f} m{share} and {math.degrees(turned):.1f} deg off at the end."
    )


@contextmanager
def _progress(duration: float, drive: Drives) -> Iterator[Callable[[float], None]]:
    """Show simulated time on stderr while the block runs; on a terminal, but not over a driver's plan."""
    if not sys.stderr.isatty() or drive is Drives.KEYBOARD:
        yield lambda _: None
        return
    from rich.console import Console

    with Console(stderr=True).status("Simulating") as status:
        said = 0.0

        def show(stamp: float) -> None:
            nonlocal said
            if stamp - said >= 1.0:
                said = stamp
                status.update(f"Simulating: {stamp:.0f} s of {duration:.0f} s at most")

        yield show
