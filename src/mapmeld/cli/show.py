"""``mapmeld show A [B]``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from mapmeld.cli.options import (
    DEFAULT_METHOD,
    Force,
    MapA,
    Method,
    ParamsFile,
    PictureOut,
    Resolution,
    Settings,
    Transform,
)

if TYPE_CHECKING:
    from mapmeld.grid import OccupancyGrid
    from mapmeld.report import Picture


def show(
    a: MapA,
    out: PictureOut,
    b: Annotated[str | None, typer.Argument(metavar="[B]", help="A map to lay over A.")] = None,
    transform: Transform = None,
    force: Force = False,
    method: Method = DEFAULT_METHOD,
    params: ParamsFile = None,
    settings: Settings = None,
    resolution: Resolution = None,
) -> None:
    """Draw a map, or two maps over one another: A red, B blue, common walls green.

    Exits with 1, and writes nothing, if B has to be matched and does not fit.
    """
    from mapmeld.cli.maps import load_maps, names_of
    from mapmeld.cli.parameters import effective_parameters
    from mapmeld.cli.placement import accepted_match, given_transform
    from mapmeld.cli.progress import working
    from mapmeld.cli.tables import pose_text, print_lines
    from mapmeld.report import check_picture_path, overlay, write_picture
    from mapmeld.se2 import Pose2

    check_picture_path(out, force=force)
    parameters = effective_parameters(method, params, settings)
    if b is None:
        if transform is not None:
            raise typer.BadParameter("needs a second map, B", param_hint="--transform")
        with working("Drawing"):
            grid, *_ = load_maps([a], resolution)
            write_picture(_single(grid, *names_of([a])), out, force=force)
        print_lines(f"Written: {out}")
        return
    given = None if transform is None else given_transform(transform, a, b)
    with working("Drawing" if given else "Matching and drawing"):
        grid_a, grid_b = load_maps([a, b], resolution)
        T_a_b = given or accepted_match(grid_a, grid_b, method, parameters).T_a_b
        names = [f"{letter}: {name}" for letter, name in zip("ab", names_of([a, b]), strict=True)]
        caption = f"Map b lies on map a at {pose_text(T_a_b)}{' (given)' if given else ''}."
        write_picture(overlay([grid_a, grid_b], [Pose2(), T_a_b], names, caption), out, force=force)
    print_lines(f"T_a_b: {pose_text(T_a_b)}", f"Written: {out}")


def _single(grid: OccupancyGrid, name: str) -> Picture:
    from mapmeld.report import Panel, compose, paint_map, with_turn

    canvas = paint_map(grid)
    rows, cols = grid.shape
    caption = (
        f"{name}: {cols} x {rows} cells of {grid.resolution:g} m, {grid.known_area:.1f} square metres known."
    )
    caption = with_turn(caption, grid)
    return compose([Panel(canvas.picture)], caption, (), canvas.px_per_cell / grid.resolution)
