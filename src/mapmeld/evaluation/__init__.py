"""How good is a matcher: data sets with known truth, trials, scores, calibration, tables, pictures.

The steps of a benchmark: `read_dataset`, `plan_trials`, `run_trials`, `summaries`; rows are kept by
`mapmeld.evaluation.store` and drawn by `mapmeld.evaluation.plots` (extra `benchmark`).
"""

from mapmeld.evaluation.navigability import Navigability, NavigabilityError, Reach, Way, navigability, reach
from mapmeld.evaluation.pairs import Dataset, DatasetError, Kind, Pair, read_dataset
from mapmeld.evaluation.plan import PlanError, Trial, plan_trials
from mapmeld.evaluation.rows import TrialRow
from mapmeld.evaluation.score import PoseErrors, Tolerance, accuracy, overlap_centroid, pose_errors
from mapmeld.evaluation.tables import Summary, markdown_table, rich_table, summaries
from mapmeld.evaluation.trials import run_trials
from mapmeld.parallel import WorkerDiedError

__all__ = [
    "Dataset",
    "DatasetError",
    "Kind",
    "Navigability",
    "NavigabilityError",
    "Pair",
    "PlanError",
    "PoseErrors",
    "Reach",
    "Summary",
    "Tolerance",
    "Trial",
    "TrialRow",
    "Way",
    "WorkerDiedError",
    "accuracy",
    "markdown_table",
    "navigability",
    "overlap_centroid",
    "plan_trials",
    "pose_errors",
    "reach",
    "read_dataset",
    "rich_table",
    "run_trials",
    "summaries",
]
