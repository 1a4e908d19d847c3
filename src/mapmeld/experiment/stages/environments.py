"""Stage 1: an environment drawn at random, with its true map."""

from __future__ import annotations

import time
from pathlib import Path

from mapmeld.experiment.folder import environment_folder, write_row
from mapmeld.experiment.rows import EnvironmentRow
from mapmeld.experiment.settings import ExperimentSettings
from mapmeld.io import save
from mapmeld.io.folders import whole_folder
from mapmeld.report import write_picture
from mapmeld.simulation import generate, mjcf, true_map, write_configuration, write_map_text
from mapmeld.simulation.fields import rooms_of
from mapmeld.simulation.pictures import environment_picture

ROW = "environment.json"


def make_environment(root: Path, settings: ExperimentSettings, environment: int) -> None:
    """Draw an environment and write its folder: what `mapmeld environment` writes, and its row."""
    began = time.process_time()
    seed = settings.environment_seed(environment)
    place = generate(settings.place, seed)
    truth = true_map(place, settings.slam.delta)
    with whole_folder(environment_folder(root, environment), force=False, ours=()) as folder:
        write_map_text(place.fields, folder / "map.txt")
        write_configuration(settings.place.configuration, folder / "config.txt")
        save(truth, folder / "map.yaml")
        (folder / "environment.xml").write_text(mjcf(place), encoding="utf-8")
        write_picture(environment_picture(place), folder / "plan.png")
        width, height = place.size
        row = EnvironmentRow(
            environment=environment,
            seed=seed,
            width=float(width),
            height=float(height),
            rooms=int(rooms_of(place.fields).max(initial=0)),
            doors=len(place.doors()),
            furniture=len(place.furniture),
            floor=float(truth.free.sum()) * truth.resolution**2,
            seconds=time.process_time() - began,
        )
        write_row(folder / ROW, row)
