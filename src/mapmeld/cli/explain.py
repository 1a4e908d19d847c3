"""``mapmeld explain A B -o DIR``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from mapmeld.cli.errors import NO_MATCH
from mapmeld.cli.options import FolderOut, Force, MapA, MapB, ParamsFile, Resolution, Settings

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mapmeld.report import Explanation

# Beside the pictures.
DOCUMENTS = ("index.md", "parameters.yaml", "result.json")


def explain(
    a: MapA,
    b: MapB,
    out: FolderOut,
    force: Force = False,
    params: ParamsFile = None,
    settings: Settings = None,
    resolution: Resolution = None,
) -> None:
    """Match two maps by the paper's method, alphabet, and write a picture of every step of it.

    The other commands use another method unless told otherwise. The folder is written even if the maps
    do not match: it shows where the method failed.
    """
    from mapmeld.cli.maps import load_maps, names_of
    from mapmeld.cli.parameters import effective_parameters
    from mapmeld.cli.progress import working
    from mapmeld.cli.tables import print_lines, print_match
    from mapmeld.io.folders import check_folder, whole_folder
    from mapmeld.matching import Verdict
    from mapmeld.report import POSSIBLE_NAMES
    from mapmeld.report import explain as explain_maps

    check_folder(out, force=force)
    parameters = effective_parameters("alphabet", params, settings)
    with working("Matching and drawing"):
        name_a, name_b = names_of([a, b])
        grid_a, grid_b = load_maps([a, b], resolution)
        explanation = explain_maps(grid_a, grid_b, parameters, (name_a, name_b))
        with whole_folder(out, force=force, ours=(*POSSIBLE_NAMES, *DOCUMENTS)) as folder:
            write_explanation(explanation, parameters, [a, b], folder)
    print_match(explanation.result, [a, b])
    print_lines("", f"Written: {out} ({len(explanation.figures)} pictures; begin with index.md)")
    if explanation.result.verdict is not Verdict.ACCEPTED:
        raise typer.Exit(NO_MATCH)


def write_explanation(explanation: Explanation, parameters: Any, paths: Sequence[str], folder: Path) -> None:
    """Write the pictures, a page that shows them, the settings and the result into a folder."""
    from mapmeld import __version__
    from mapmeld.cli.json_output import as_json, match_fields
    from mapmeld.cli.maps import names_of
    from mapmeld.cli.parameters import parameters_as_yaml
    from mapmeld.io.atomic import write_files
    from mapmeld.report import write_picture

    for figure in explanation.figures:
        write_picture(figure.picture, folder / figure.name)
    texts = {
        "index.md": _page(explanation, names_of(paths)),
        "parameters.yaml": parameters_as_yaml("alphabet", parameters, __version__),
        "result.json": as_json(match_fields(explanation.result, parameters, paths)) + "\n",
    }
    write_files(
        [(folder / name, (text.encode("utf-8", "backslashreplace"),)) for name, text in texts.items()]
    )


def _page(explanation: Explanation, names: Sequence[str]) -> str:
    from mapmeld import __version__
    from mapmeld.cli.tables import pose_text
    from mapmeld.io import printable

    result = explanation.result
    lines = [
        f"# `{printable(names[0])}` (a) and `{printable(names[1])}` (b)",
        "",
        f"**{str(result.verdict).capitalize()}**: {result.reason}.",
        "",
        f"T_a_b, which takes a point of b to a: {pose_text(result.T_a_b)}.",
        "",
        "Settings are in `parameters.yaml`, all figures of the result in `result.json`.",
        "",
    ]
    for figure in explanation.figures:
        number, title = Path(figure.name).stem.split("_", 1)
        lines += [f"## {int(number)}. {title.replace('_', ' ').capitalize()}", ""]
        lines += [figure.caption, "", f"![{figure.caption}]({figure.name})", ""]
    lines.append(f"Written by mapmeld {__version__}.")
    return "\n".join(lines) + "\n"
