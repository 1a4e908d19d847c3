"""``mapmeld index DIR``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mapmeld.cli.options import Force, Workers
from mapmeld.wording import plural


def index(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Maps are looked for in it and below it.")],
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", metavar="INDEX", help="The index; by default DIR/mapmeld.index."),
    ] = None,
    workers: Workers = 1,
    force: Force = False,
) -> None:
    """Describe all maps under a folder, so that `mapmeld find` need not match them all.

    An index that is there is brought up to date: maps that have not changed are not read again. --force
    makes it anew. Files that cannot be read as maps are named and passed over.
    """
    from mapmeld.cli.errors import say
    from mapmeld.cli.progress import counting
    from mapmeld.cli.tables import print_files, print_lines
    from mapmeld.index import MapIndexError, build_index, is_index, map_files, read_index, write_index
    from mapmeld.io.atomic import check_targets

    target = folder / "mapmeld.index" if out is None else out
    names = map_files(folder)
    exists = target.exists() or target.is_symlink()
    check_targets([target], force=force or is_index(target))
    known = read_index(target) if exists and not force else None
    if known is not None and known.root != folder.resolve():
        raise MapIndexError.of(
            target, f"is the index of another folder, {known.root}; choose another name, or --force"
        )
    with counting("Reading maps", len(names)) as step:
        built = build_index(
            folder.resolve(),
            names,
            known,
            workers=0 if workers == 1 else workers,
            on_map=step,
            on_progress=lambda so_far: write_index(so_far, target),
        )
    if not built.index.maps and built.skipped:
        _, problem = built.skipped[0]
        raise MapIndexError.of(folder, f"none of its {len(built.skipped)} YAML files is a map, as: {problem}")
    write_index(built.index, target)
    for _, problem in built.skipped:
        say(f"skipped: {problem}")
    counts = (
        f"{built.read} read, {built.kept} unchanged, {len(built.gone)} gone, {len(built.skipped)} skipped"
    )
    print_lines(f"{plural(len(built.index.maps), 'map')} in the index: {counts}.")
    print_files([target])
