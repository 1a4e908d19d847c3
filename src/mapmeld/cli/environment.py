"""``mapmeld environment [ENV] -o DIR``."""

from __future__ import annotations

from typing import Annotated

import typer

from mapmeld.cli.options import FolderOut, Force
from mapmeld.cli.simulation_options import (
    ConfigFile,
    Door,
    EnvironmentFile,
    ExtraDoors,
    FurnitureDensity,
    Seed,
    Size,
    Wall,
)

FILES = ("map.txt", "config.txt", "map.yaml", "map.pgm", "environment.xml", "plan.png")


def environment(
    out: FolderOut,
    file: EnvironmentFile = None,
    seed: Seed = 0,
    config: ConfigFile = None,
    size: Size = None,
    extra_doors: ExtraDoors = None,
    furniture: FurnitureDensity = 1.0,
    wall: Wall = 0.1,
    door: Door = 0.9,
    resolution: Annotated[
        float, typer.Option("--resolution", metavar="METRES", help="Side of a cell of the true map.")
    ] = 0.05,
    force: Force = False,
) -> None:
    """Draw a random indoor environment, or read one, and write its true map and simulator model.

    Writes map.txt and config.txt as the V-REP map generator has them, the true map for map_server
    (map.yaml), environment.xml for MuJoCo, and plan.png to look at.
    """
    from mapmeld.cli.simulation_options import described, wanted_environment
    from mapmeld.cli.tables import print_lines
    from mapmeld.io import save
    from mapmeld.io.folders import check_folder, whole_folder
    from mapmeld.report import write_picture
    from mapmeld.simulation.mjcf import mjcf
    from mapmeld.simulation.pictures import environment_picture
    from mapmeld.simulation.true_map import true_map
    from mapmeld.simulation.vrep_files import write_configuration, write_map_text

    check_folder(out, force=force)
    made, settings = wanted_environment(file, seed, config, size, extra_doors, furniture, wall, door)
    grid = true_map(made, resolution)
    with whole_folder(out, force=force, ours=FILES) as folder:
        write_map_text(made.fields, folder / "map.txt")
        if file is None:
            write_configuration(settings.configuration, folder / "config.txt")
        save(grid, folder / "map.yaml")
        (folder / "environment.xml").write_text(mjcf(made), encoding="utf-8")
        write_picture(environment_picture(made), folder / "plan.png")
    print_lines(
        described(made),
        f"Written to {out}:",
        "  map.txt                  walls and doors, as the V-REP map generator writes them",
        *(["  config.txt               what was drawn, as that generator reads it"] if file is None else []),
        "  map.yaml, map.pgm        the true map, as ROS map_server and nav2 read it",
        "  environment.xml          the model for MuJoCo",
        "  plan.png                 the floor plan",
    )
