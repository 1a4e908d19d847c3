"""Arguments and options that several commands share."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

DEFAULT_METHOD = "correlative"
"""That of `mapmeld.matching`, named here so that help need not import it."""

# Texts, not Paths: maps in recordings are named by more than a file.
MapA = Annotated[
    str,
    typer.Argument(
        metavar="A",
        help="A map: YAML file of map_server or nav2, a bare image, or RECORDING#topic@seconds.",
    ),
]
MapB = Annotated[str, typer.Argument(metavar="B", help="The map to lay on A.")]

Old = Annotated[str, typer.Argument(metavar="OLD", help="The earlier map, in any form that A can have.")]
New = Annotated[str, typer.Argument(metavar="NEW", help="The later map.")]
MapOut = Annotated[Path, typer.Option("-o", "--out", metavar="YAML", help="The map to write.")]

Method = Annotated[
    str, typer.Option("--method", metavar="NAME", help="How to match; a wrong name makes it list them all.")
]
ParamsFile = Annotated[
    Path | None,
    typer.Option("--params", metavar="FILE", help="YAML file with settings of the method."),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="One setting of the method; may be repeated. '--set help' alone lists all there are.",
    ),
]
Resolution = Annotated[
    float | None,
    typer.Option("--resolution", metavar="METRES", help="Side of a cell in maps that are bare images."),
]
Transform = Annotated[
    str | None,
    typer.Option(
        "--transform",
        metavar="X,Y,DEG | FILE.json",
        help="How the second map lies on the first, instead of matching them: metres and degrees, or the "
        "answer of 'mapmeld match --json' for these maps.",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object instead (see docs/json.md).")]
Force = Annotated[bool, typer.Option("--force", help="Replace files that exist.")]
PictureOut = Annotated[Path, typer.Option("-o", "--out", metavar="PNG", help="The picture to write.")]
FolderOut = Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="The folder to write.")]

KnownPoses = Annotated[
    Path | None,
    typer.Option(
        "--known-poses", metavar="YAML", help="Poses of maps that are known beforehand (docs/graph.md)."
    ),
]
NoMatch = Annotated[
    bool, typer.Option("--no-match", help="Match nothing: the maps lie where --known-poses says.")
]
Workers = Annotated[
    int,
    typer.Option(
        "--workers", metavar="N", min=1, help="Processes, of one thread each; 1: all in this process."
    ),
]
Cluster = Annotated[
    str | None,
    typer.Option("--cluster", metavar="ADDRESS", help="Work on the Dask cluster of this scheduler instead."),
]
Candidates = Annotated[
    int | None,
    typer.Option(
        "--candidates",
        metavar="K",
        min=1,
        help="Match each map only with the K that look most like it (docs/map_index.md), not with all.",
    ),
]
Store = Annotated[
    Path | None,
    typer.Option("--store", metavar="DIR", help="Keep all matches there; a second run goes on from it."),
]


class Strategy(StrEnum):
    """Those of `mapmeld.merge`."""

    GRAPH = "graph"
    SEQUENTIAL = "sequential"


class Solver(StrEnum):
    """Those of `mapmeld.merge`."""

    OWN = "own"
    GTSAM = "gtsam"


SolverChoice = Annotated[
    Solver, typer.Option("--solver", help="Of the robust optimisation; gtsam is an extra.")
]


class Fusion(StrEnum):
    """The rules of `mapmeld.merging.FUSIONS`, listed here so that help need not import them."""

    COLOUR = "colour"
    LOG_ODDS = "log-odds"
    AVERAGE = "average"
    NEWEST = "newest"
    VOTE = "vote"


class WriteMode(StrEnum):
    """The modes of `mapmeld.io.save`."""

    TRINARY = "trinary"
    SCALE = "scale"
    RAW = "raw"
