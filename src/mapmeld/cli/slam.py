"""``mapmeld slam LOG -o DIR``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mapmeld.cli.errors import say
from mapmeld.cli.options import FolderOut, Force
from mapmeld.wording import plural

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from mapmeld.grid import OccupancyGrid
    from mapmeld.recording import Scan
    from mapmeld.slam import GMapping, GMappingParameters

MAP = "map.yaml"
TRAJECTORY = "trajectory.txt"
HISTORY = "history"
_OURS = (MAP, "map.pgm", TRAJECTORY)


def slam(
    file: Annotated[
        str,
        typer.Argument(
            metavar="FILE",
            help="Scans and odometry: a CARMEN log (.gz too), or a recording (rosbag1, rosbag2, MCAP).",
        ),
    ],
    out: FolderOut,
    scan: Annotated[
        str | None, typer.Option(metavar="TOPIC", help="Scans of a recording, if they are on several topics.")
    ] = None,
    odom: Annotated[
        str | None,
        typer.Option(
            metavar="TOPIC",
            help="Odometry of a recording, if it is on several topics; or /tf, from frame odom.",
        ),
    ] = None,
    history: Annotated[
        bool,
        typer.Option("--history", help="Also write the map at the end of every second in which it changed."),
    ] = False,
    every: Annotated[float, typer.Option(metavar="SECONDS", min=0.001, help="Length of that second.")] = 1.0,
    seed: Annotated[int, typer.Option(metavar="S", min=0, help="Of all randomness.")] = 0,
    params: Annotated[
        Path | None,
        typer.Option("--params", metavar="FILE", help="YAML file with parameters of slam_gmapping."),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="One parameter, by the name it has in slam_gmapping; may be repeated. "
            "'--set help' lists all there are.",
        ),
    ] = None,
    force: Force = False,
) -> None:
    """Make a map of what a robot with a laser recorded, by GMapping's method (extra 'sim').

    Writes map.yaml with its image, trajectory.txt (t x y z qx qy qz qw), and with --history a folder of
    map_server maps with their times in times.txt. DIR appears when all is done, or not at all.
    """
    from mapmeld.cli.progress import counted, working
    from mapmeld.cli.tables import print_lines
    from mapmeld.extras import required
    from mapmeld.io import save
    from mapmeld.io.folders import check_folder, whole_folder
    from mapmeld.io.history_writer import history_files, write_history
    from mapmeld.io.scans import open_scans

    required("numba", "sim")
    from mapmeld.slam import GMapping, prepare, write_trajectory

    parameters = _parameters(params, settings)
    check_folder(out, force=force)
    with working("Reading"):
        stream = open_scans(file, scan, odom)
    with working("Getting ready (the first time, code has to be compiled)"):
        prepare()
    mapper = GMapping(stream.laser, parameters, seed)
    earlier = [f"{HISTORY}/{name}" for name in history_files(out / HISTORY)]
    with whole_folder(out, force=force, ours=(*_OURS, *earlier)) as folder:
        scans = counted(stream.scans, "Mapping, scans")
        maps = 0
        if history:
            maps = len(write_history(_states(mapper, scans, every, file), folder / HISTORY))
        else:
            for taken in scans:
                mapper.add(taken)
            _check(mapper, file)
        grid = mapper.map()
        save(grid, folder / MAP)
        path = mapper.trajectory()
        write_trajectory(path, folder / TRAJECTORY)
    rows, cols = grid.shape
    print_lines(
        f"{plural(len(path.stamps), 'scan')} used over {path.stamps[-1] - path.stamps[0]:.1f} s; "
        f"a map of {cols * grid.resolution:.1f} m x {rows * grid.resolution:.1f} m, "
        f"{grid.known_area:.1f} m² known",
        "",
        f"Written to {out}:",
        f"  {MAP}, map.pgm  the map, as ROS map_server and nav2 read it",
        f"  {TRAJECTORY}     t x y z qx qy qz qw of the robot at these scans",
        *(
            [f"  {HISTORY}/           {plural(maps, 'state')} of the map, with times in times.txt"]
            if history
            else []
        ),
    )
    for reason, times in sorted(stream.left_out.items()):
        say(f"note: {file}: {reason}" + (f" ({times} times)" if times > 1 else ""))


def _states(mapper: GMapping, scans: Iterable[Scan], every: float, file: str) -> Iterator[OccupancyGrid]:
    from mapmeld.slam import states

    yield from states(mapper, scans, every)
    _check(mapper, file)


def _check(mapper: GMapping, file: str) -> None:
    from mapmeld.io.scan_stream import ScanFileError

    if not mapper.has_map:
        raise ScanFileError.of(file, "has no scan from which a map could be made")


def _parameters(params: Path | None, settings: list[str] | None) -> GMappingParameters:
    from mapmeld.cli.parameters import ParametersError, changed_settings
    from mapmeld.slam import GMappingParameters, read_parameters

    owner = "slam_gmapping"
    given: dict[str, object] = {}
    if params is not None:
        found = read_parameters(params)
        given |= found.settings
        if found.passed_over:
            say(f"note: {params}: of the ROS node alone, and not used: {', '.join(found.passed_over)}")
    given |= changed_settings(settings, GMappingParameters, owner)
    try:
        return GMappingParameters(**given)  # type: ignore[arg-type]
    except ValueError as error:
        raise ParametersError(f"parameters of {owner}: {error}") from error
