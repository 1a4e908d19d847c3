"""Why a matching failed, on a room drawn by hand."""

from dataclasses import replace

from drawing import office

from mapmeld.experiment.rows import MappingRow
from mapmeld.experiment.stages.mapped import Mapped
from mapmeld.experiment.stages.matchings import cause_of_failure
from mapmeld.matching import MatchResult, Verdict
from mapmeld.se2 import Pose2

ROW = MappingRow(
    environment=1,
    mapping=1,
    seed=0,
    start=(0.0, 0.0, 0.0),
    duration=1.0,
    driven=1.0,
    scans=1,
    used=1,
    states=1,
    known_area=1.0,
    position_error=0.1,
    position_error_end=0.4,
    odometry_error_end=1.0,
    accuracy=0.9,
    accuracy_over_time=(),
    simulation_seconds=1.0,
    slam_seconds=1.0,
    seconds=1.0,
)
HERE = Pose2()
ONE = Mapped(office(), Pose2(), ROW)
TWO = Mapped(office(), Pose2(), replace(ROW, position_error_end=0.7))


def cause(T: Pose2 | None, similarity: float = 0.3, of_truth: float = 0.2, truth: Pose2 = HERE) -> str:
    best = MatchResult(T, Verdict.REJECTED, "no corners", similarity=similarity)
    return cause_of_failure(best, truth, ONE, TWO, of_truth)


def test_every_cause() -> None:
    assert cause(None) == "nothing found: no corners"
    assert cause_of_failure(None, Pose2(), ONE, TWO, 0.0) == "nothing found: no states"
    assert cause(Pose2(0.6, 0.0, 0.0)) == (
        "near miss: 0.60 m and 0.0 degrees off; SLAM itself ended up to 0.70 m off"
    )
    assert cause(Pose2(5.0, 0.0, 0.0)).startswith("misled: a wrong transform is more alike (0.30)")
    assert cause(Pose2(5.0, 0.0, 0.0), 0.1).startswith(
        "not found: the true transform would be more alike (0.20)"
    )
    assert cause(Pose2(), truth=Pose2(1000.0, 0.0, 0.0)) == "no common area"
