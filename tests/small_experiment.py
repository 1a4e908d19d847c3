"""One small experiment for many tests: rooms so small that a tour takes seconds."""

from __future__ import annotations

from dataclasses import replace

from mapmeld.experiment import ExperimentSettings
from mapmeld.simulation import Settings

PLACE = Settings(width=10, height=8)
SETTINGS = ExperimentSettings(
    environments=1,
    mappings=3,
    place=replace(PLACE, configuration=replace(PLACE.configuration, rooms=2)),
)
AS_OPTIONS = ("--environments", 1, "--mappings", 3, "--size", "10x8", "--rooms", 2)
