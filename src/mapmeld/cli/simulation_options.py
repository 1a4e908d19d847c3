"""Options of the commands that make environments, and the environment that they ask for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from mapmeld.simulation.environment import Environment
    from mapmeld.simulation.generator import Settings

EnvironmentFile = Annotated[
    Path | None,
    typer.Argument(
        metavar="[ENV]", help="Map text of the V-REP map generator; drawn at random if not given."
    ),
]
Seed = Annotated[int, typer.Option(metavar="N", min=0, help="Of all randomness: the same gives the same.")]
ConfigFile = Annotated[
    Path | None,
    typer.Option("--config", metavar="FILE", help="Configuration of the V-REP map generator: rooms to draw."),
]
Size = Annotated[
    str | None, typer.Option("--size", metavar="WxH", help="Of the ground, in metres (20x20 if not given).")
]
ExtraDoors = Annotated[
    float | None,
    typer.Option(
        metavar="P", min=0.0, max=1.0,
        help="Probability of a door between neighbouring rooms that need none (0.3 if not given).",
    ),
]  # fmt: skip
FurnitureDensity = Annotated[
    float,
    typer.Option("--furniture", metavar="D", min=0.0, max=3.0, help="Density of furniture; 0 for none."),
]
Wall = Annotated[float, typer.Option("--wall", metavar="M", help="Thickness of walls, in metres.")]
Door = Annotated[float, typer.Option("--door", metavar="M", help="Width of doors, in metres.")]


def wanted_environment(
    file: Path | None,
    seed: int,
    config: Path | None,
    size: str | None,
    extra_doors: float | None,
    furniture: float,
    wall: float,
    door: float,
) -> tuple[Environment, Settings]:
    """Read or draw the environment that the options ask for; the settings are those it was drawn with.

    Raises
    ------
    MapmeldError
        A file cannot be read, or the options contradict one another.
    """
    from mapmeld.simulation.environment import Environment
    from mapmeld.simulation.furnishing import furnish
    from mapmeld.simulation.generator import Settings, generate
    from mapmeld.simulation.vrep_files import read_configuration, read_map_text

    settings = Settings(furniture=furniture, wall=wall, door=door)
    if file is not None:
        for option, value in (("--config", config), ("--size", size), ("--extra-doors", extra_doors)):
            if value is not None:
                raise typer.BadParameter(
                    "is for environments drawn at random; ENV has its walls", param_hint=option
                )
        return furnish(Environment(read_map_text(file), wall=wall, door=door), seed, furniture), settings
    if config is not None:
        settings = replace(settings, configuration=read_configuration(config))
    if size is not None:
        width, height = _sides(size)
        settings = replace(settings, width=width, height=height)
    if extra_doors is not None:
        settings = replace(settings, extra_doors=extra_doors)
    return generate(settings, seed), settings


def _sides(text: str) -> tuple[int, int]:
    try:
        width, height = map(int, text.lower().split("x"))
    except ValueError:
        raise typer.BadParameter(
            f"whole metres are needed, as 20x15, not {text!r}", param_hint="--size"
        ) from None
    return width, height


def described(environment: Environment) -> str:
    """Return a line about an environment."""
    from mapmeld.simulation.fields import rooms_of

    width, height = environment.size
    rooms = int(rooms_of(environment.fields).max(initial=0))
    doors, pieces = len(environment.doors()), len(environment.furniture)
    return f"{width:g} x {height:g} m, {rooms} rooms, {doors} doors, {pieces} pieces of furniture"
