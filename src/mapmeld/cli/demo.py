"""``mapmeld demo``: the whole tool on the maps that come with it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from mapmeld.cli.errors import NO_MATCH
from mapmeld.cli.options import FolderOut, Force

if TYPE_CHECKING:
    from mapmeld.se2 import Pose2

_MAPS = ("robot_1.yaml", "robot_2.yaml")


def demo(out: FolderOut = Path("mapmeld-demo"), force: Force = False) -> None:
    """Match and merge two maps that come with mapmeld, and show the paper's method in pictures."""
    from mapmeld.cli.example_maps import example_map
    from mapmeld.cli.explain import DOCUMENTS, write_explanation
    from mapmeld.cli.maps import load_maps
    from mapmeld.cli.progress import working
    from mapmeld.cli.tables import pose_text, print_lines, print_match
    from mapmeld.io import save
    from mapmeld.io.folders import check_folder, whole_folder
    from mapmeld.matching.alphabet import AlphabetParameters
    from mapmeld.merging import merge
    from mapmeld.report import POSSIBLE_NAMES, explain, overlay, references, write_picture

    check_folder(out, force=force)
    paths = [str(example_map(name)) for name in _MAPS]
    pages = [f"explain/{name}" for name in (*POSSIBLE_NAMES, *DOCUMENTS)]
    ours = ["merged.yaml", "merged.pgm", "overlay.png", "references.png", *pages]
    with working("Matching, merging and drawing"):
        a, b = load_maps(paths, None)
        merged = merge([a, b])
        parameters = AlphabetParameters()
        explanation = explain(a, b, parameters, _MAPS)
        T_1_2 = merged.poses[1]
        if T_1_2 is not None:
            with whole_folder(out, force=force, ours=ours) as folder:
                save(merged.grid, folder / "merged.yaml")
                caption = f"{_MAPS[1]} lies on {_MAPS[0]} at {pose_text(T_1_2)}."
                picture = overlay([a, b], [merged.poses[0] or T_1_2, T_1_2], _MAPS, caption)
                write_picture(picture, folder / "overlay.png")
                picture = references(merged.grid, merged.starts, _MAPS, "The merged map.")
                write_picture(picture, folder / "references.png")
                (folder / "explain").mkdir()
                write_explanation(explanation, parameters, paths, folder / "explain")
    print_lines("Two simulated robots mapped parts of one office floor, each from its own start.", "")
    print_match(merged.joints[0].result if merged.joints else merged.refused[1], paths)
    if T_1_2 is None:
        print_lines("", "The maps could not be joined; nothing written.")
        raise typer.Exit(NO_MATCH)
    truth = _truth()
    if truth is not None:
        metres, radians = T_1_2.distance_to(truth)
        print_lines(
            "",
            f"The simulation knows the truth: the start of robot 2 is found {100 * metres:.1f} cm and "
            f"{math.degrees(radians):.2f} deg off.",
        )
    print_lines(
        "",
        f"Written to {out}:",
        "  merged.yaml, merged.pgm  the merged map, as ROS map_server and nav2 read it",
        "  references.png           the merged map and where each robot started",
        "  overlay.png              robot 1 red, robot 2 blue, walls that both saw green",
        "  explain/index.md         how the paper's method, alphabet, goes about it, step by step,",
        f"                           in {len(explanation.figures)} pictures",
        "",
        "With maps of your own:  mapmeld merge A.yaml B.yaml -o merged.yaml",
    )


def _truth() -> Pose2 | None:
    """Return the true T_1_2 of the example maps, where the file that holds it came along."""
    import yaml

    from mapmeld.cli.example_maps import ExamplesError, example_map
    from mapmeld.se2 import Pose2

    try:
        truth = yaml.safe_load(example_map("truth.yaml").read_text(encoding="utf-8"))
    except ExamplesError:
        return None
    x, y, theta = truth["transforms"]["T_1_2"]
    return Pose2(x, y, theta)
