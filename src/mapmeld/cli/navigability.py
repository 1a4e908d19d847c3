"""``mapmeld navigability MAP``."""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mapmeld.cli.errors import NO_MATCH, say
from mapmeld.cli.options import DEFAULT_METHOD, Force, Json, Resolution
from mapmeld.wording import plural

if TYPE_CHECKING:
    from mapmeld.evaluation import Navigability, Reach
    from mapmeld.grid import OccupancyGrid
    from mapmeld.matching import MatchResult
    from mapmeld.report import Picture
    from mapmeld.se2 import Pose2


def navigability(
    map_: Annotated[
        str,
        typer.Argument(
            metavar="MAP",
            help="A map, in any form that other commands take.",
        ),
    ],
    truth: Annotated[
        str | None,
        typer.Option("--truth", metavar="TRUE", help="The true map of the place, to compare with."),
    ] = None,
    pose: Annotated[
        str | None,
        typer.Option(
            "--pose",
            metavar="X,Y,DEG",
            help="How MAP lies on TRUE, in metres and degrees; without it and --align in one frame.",
        ),
    ] = None,
    align: Annotated[
        bool, typer.Option("--align", help="Match MAP to TRUE to find out how it lies.")
    ] = False,
    radius: Annotated[
        float, typer.Option(metavar="METRES", min=0, max=100, help="Of the robot, which is round.")
    ] = 0.2,
    tolerance: Annotated[
        float,
        typer.Option(
            metavar="METRES",
            min=0,
            max=100,
            help="How far a robot may give way from what was planned on MAP.",
        ),
    ] = 0.2,
    start: Annotated[
        list[str] | None,
        typer.Option(
            metavar="X,Y", help="Where a robot stood on MAP: poses are what it reaches. One for each robot."
        ),
    ] = None,
    pairs: Annotated[int, typer.Option(metavar="N", min=1, max=100_000, help="Of random poses.")] = 200,
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Of the random poses.")] = 0,
    picture: Annotated[
        Path | None,
        typer.Option(
            "--picture", metavar="PNG", help="Draw where a robot can be and, with --truth, the ways."
        ),
    ] = None,
    force: Force = False,
    json: Json = False,
    resolution: Resolution = None,
) -> None:
    """Find out what a round robot can reach on a map, and with --truth, which ways planned on it are right.

    False passages lead through what is an obstacle in truth, false blocks are where only the map has no way;
    the length ratio is planned way / true shortest. Exits with 1 if --align finds no acceptable match.
    """
    from mapmeld.cli.json_output import as_json, how_matched, navigability_fields
    from mapmeld.cli.maps import load_maps
    from mapmeld.cli.parameters import effective_parameters
    from mapmeld.cli.placement import transform_of_numbers
    from mapmeld.cli.progress import working
    from mapmeld.cli.tables import print_lines
    from mapmeld.evaluation import navigability as compare
    from mapmeld.evaluation import reach
    from mapmeld.report import check_picture_path, write_picture
    from mapmeld.se2 import Pose2

    if truth is None and (pose is not None or align):
        raise typer.BadParameter("needs a true map, --truth", param_hint="--pose" if pose else "--align")
    if pose is not None and align:
        raise typer.BadParameter("says what --align is to find out; give one of them", param_hint="--pose")
    T_truth_map = Pose2() if pose is None else transform_of_numbers(pose, "--pose", "")
    starts = None if not start else [_start(text) for text in start]
    if picture is not None:
        check_picture_path(picture, force=force)
    parameters = effective_parameters(DEFAULT_METHOD, None, None)
    began = time.perf_counter()
    with working("Planning"):
        grid, *rest = load_maps([map_] if truth is None else [map_, truth], resolution)
        matched: MatchResult | None = None
        if align:
            matched = _matched(rest[0], grid, parameters)
            T_truth_map = matched.T_a_b or T_truth_map
        reached = reach(grid, radius=radius, starts=starts, pairs=pairs, seed=seed)
        found = None
        if rest:
            found = compare(
                grid,
                rest[0],
                T_truth_map,
                radius=radius,
                tolerance=tolerance,
                starts=starts,
                pairs=pairs,
                seed=seed,
            )
        if picture is not None:
            drawn = _picture(
                grid, radius, found, (rest[0], T_truth_map) if rest else None, _summary(reached, found)
            )
            write_picture(drawn, picture, force=force)
    if json:
        settings = {
            "radius": radius,
            "tolerance": tolerance,
            "starts": None if starts is None else [[p.x, p.y] for p in starts],
            "pairs": pairs,
            "seed": seed,
        }
        fields = navigability_fields(
            (map_, truth),
            T_truth_map if rest else None,
            how_matched(matched, parameters),
            settings,
            reached,
            found,
            time.perf_counter() - began,
        )
        typer.echo(as_json(fields))
        return
    print_lines(*_lines(reached, found, radius))
    if picture is not None:
        print_lines(f"Written: {picture}")


def _start(text: str) -> Pose2:
    from mapmeld.cli.placement import transform_of_numbers

    if text.count(",") == 1:
        with suppress(typer.BadParameter):
            return transform_of_numbers(f"{text},0")
    raise typer.BadParameter(f"two numbers x,y are needed, not {text!r}", param_hint="--start")


def _matched(truth: OccupancyGrid, grid: OccupancyGrid, parameters: object) -> MatchResult:
    from mapmeld.matching import Verdict, match

    result = match(truth, grid, DEFAULT_METHOD, parameters)
    if result.verdict is not Verdict.ACCEPTED:
        say(
            f"{result.verdict}: {result.reason}; nothing compared (--pose says how the map lies on the truth)"
        )
        raise typer.Exit(NO_MATCH)
    return result


def _lines(reached: Reach, found: Navigability | None, radius: float) -> list[str]:
    def line(name: str, value: str) -> str:
        return f"{name:<16} {value}"

    lines = [
        line("free floor", f"{reached.free_area:.1f} m2"),
        line("drivable", f"{reached.drivable_area:.1f} m2, for the centre of a robot of radius {radius:g} m"),
        line(
            "reachable",
            f"{reached.reachable_area:.1f} m2; the floor is in {plural(reached.components, 'part')}",
        ),
        line("ways", f"{reached.reachable} of {plural(reached.pairs, 'pair')} of poses on the map"),
    ]
    if found is None:
        return lines
    lines += [
        "",
        f"{plural(found.pairs, 'pair')} of poses that are free on the map and in truth:",
        line("way on the map", str(found.reachable_map)),
        line("way in truth", str(found.reachable_truth)),
        line("way on both", str(found.reachable_both)),
        line("false passages", str(found.false_passages)),
        line("false blocks", str(found.false_blocks)),
    ]
    if found.length_ratio is not None:
        ratios = found.length_ratios
        lines.append(
            line("length ratio", f"median {found.length_ratio:.3f}, {min(ratios):.3f} to {max(ratios):.3f}")
        )
    return lines


def _summary(reached: Reach, found: Navigability | None) -> str:
    if found is None:
        return (
            f"{reached.reachable_area:.0f} of {reached.free_area:.0f} square metres of floor can be reached; "
            f"it is in {plural(reached.components, 'part')}."
        )
    ratio = "" if found.length_ratio is None else f" Planned ways are {found.length_ratio:.3f} times as long."
    return (
        f"Of {plural(found.pairs, 'pair')} of poses, {found.reachable_map} have a way on the map and "
        f"{found.reachable_truth} in truth.{ratio}"
    )


def _picture(
    grid: OccupancyGrid,
    radius: float,
    found: Navigability | None,
    truth: tuple[OccupancyGrid, Pose2] | None,
    caption: str,
) -> Picture:
    from mapmeld.report.navigability import navigability as draw

    return draw(grid, radius, found, truth, caption)
