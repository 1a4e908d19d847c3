"""The paper's whole experiment, sections 3 and 4, from nothing: `run_experiment`, then `write_report`.

Environments are drawn at random, robots drive through them, their scans become maps, the histories of the
maps are matched pair by pair, and all is judged by the known truth (extra ``reproduce``).
"""

from mapmeld.experiment.results import Results, read_results
from mapmeld.experiment.run import run_experiment
from mapmeld.experiment.settings import ExperimentError, ExperimentSettings

__all__ = ["ExperimentError", "ExperimentSettings", "Results", "read_results", "run_experiment"]
