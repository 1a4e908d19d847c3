"""``mapmeld rebase NEW --onto OLD -o OUT``."""

from __future__ import annotations

import math
from typing import Annotated

import typer

from mapmeld.cli.errors import say
from mapmeld.cli.options import (
    DEFAULT_METHOD,
    Force,
    Json,
    MapOut,
    Method,
    New,
    ParamsFile,
    Resolution,
    Settings,
    Transform,
)


def rebase(
    new: New,
    onto: Annotated[str, typer.Option("--onto", metavar="OLD", help="The earlier map, whose frame is kept.")],
    out: MapOut,
    lattice: Annotated[
        bool,
        typer.Option("--lattice", help="Also sample NEW on OLD's lattice, extended as far as NEW reaches."),
    ] = False,
    transform: Transform = None,
    force: Force = False,
    json: Json = False,
    method: Method = DEFAULT_METHOD,
    params: ParamsFile = None,
    settings: Settings = None,
    resolution: Resolution = None,
) -> None:
    """Write a later map in an earlier map's frame, where goals, zones and masks drawn on that stay valid.

    Without --lattice only the origin changes, and every cell stays as it is.
    """
    from mapmeld.changes import rebase as rebase_map
    from mapmeld.cli.json_output import as_json, rebase_fields
    from mapmeld.cli.maps import check_map_path, exact_mode, load_maps, names_of
    from mapmeld.cli.parameters import effective_parameters
    from mapmeld.cli.placement import Placement, accepted_match, given_transform, note_if_unlikely
    from mapmeld.cli.progress import working
    from mapmeld.cli.tables import pose_text, print_files, print_lines
    from mapmeld.io import save

    check_map_path(out, force=force)
    parameters = effective_parameters(method, params, settings)
    given = None if transform is None else given_transform(transform, onto, new)
    with working("Laying down"):
        old_grid, new_grid = load_maps([onto, new], resolution)
        if transform is not None and given is not None:
            note_if_unlikely(f"--transform {transform}", given, old_grid, new_grid, names_of([onto, new]))
        placed = (
            accepted_match(old_grid, new_grid, method, parameters)
            if given is None
            else Placement(given, None)
        )
        moved = rebase_map(new_grid, old_grid, placed.T_a_b, lattice=lattice)
        files = save(moved, out, mode=exact_mode(moved), force=force)
    if json:
        typer.echo(as_json(rebase_fields(placed, parameters, [onto, new], moved, lattice, files)))
    else:
        print_lines(f"T_old_new: {pose_text(placed.T_a_b)}")
        print_files(files)
    degrees = math.degrees(moved.origin.theta)
    if abs(degrees) > 1e-3:
        hint = "; --lattice writes a map without" if old_grid.origin.theta == 0 else ""
        say(
            f"note: the origin of {out} has a yaw of {degrees:.2f} degrees, which costmaps and AMCL of nav2 "
            f"take for none{hint}"
        )
