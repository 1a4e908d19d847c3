"""``mapmeld ros``: the live ROS 2 node."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def ros(
    context: typer.Context,
    robots: Annotated[
        str,
        typer.Option(
            metavar="auto|NAME,NAME...",
            help="Namespaces of the robots, whose maps are NAME/map; auto: all that appear.",
        ),
    ] = "auto",
    parameters: Annotated[
        list[str] | None,
        typer.Option(
            "-p", "--param", metavar="NAME:=VALUE", help="A parameter of the node; may be repeated."
        ),
    ] = None,
    file: Annotated[
        Path | None, typer.Option("--params-file", metavar="YAML", help="A ROS file of parameters.")
    ] = None,
    name: Annotated[str, typer.Option(metavar="NAME", help="Of the node.")] = "mapmeld",
) -> None:
    """Merge the maps of robots that map right now: a ROS 2 node (extra 'ros', or a ROS installation).

    What follows --ros-args goes to ROS as it is. Ends with Ctrl-C.
    """
    from mapmeld.io import MapFileError
    from mapmeld.ros.node import run

    if file is not None and not file.is_file():
        raise MapFileError.of(file, "there is no such file of parameters")
    arguments = list(context.args)
    if arguments and arguments[0] != "--ros-args":
        raise typer.BadParameter(f"{arguments[0]} is not known; what is for ROS itself follows --ros-args")
    if parameters or file is not None:
        arguments += ["--ros-args"] if "--ros-args" not in arguments else []
        for parameter in parameters or ():
            if ":=" not in parameter:
                raise typer.BadParameter(f"NAME:=VALUE is needed, not {parameter}", param_hint="--param")
            arguments += ["-p", parameter]
        arguments += ["--params-file", str(file)] if file is not None else []
    names = [part.strip() for part in robots.split(",") if part.strip()]
    run(names or ["auto"], arguments, name)
