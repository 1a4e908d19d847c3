"""One row per trial: what was tried, what the method answered, and how far that is from the truth."""

from __future__ import annotations

from dataclasses import dataclass, replace

from mapmeld.evaluation.score import PoseErrors, Tolerance

ERROR = "error"

TrialKey = tuple[str, str, str, str, str, int | None, bool, str | None, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialRow:
    """One trial. The first nine fields say what was tried: no two rows of a run agree in all of them.

    Attributes
    ----------
    dataset, pair
        Names of the data set and of the pair in it.
    inputs
        Fingerprint of the two maps and of the pair's entry: differs as soon as one of them changes.
    method
        Name of the matcher.
    parameters
        Its settings, as JSON.
    turn_seed
        Seed of the motion by which map 2 was turned first (`mapmeld.evaluation.turning`); None: as it is.
    swapped
        Whether the maps changed places: map 1 was laid on map 2.
    time_against
        Method that was timed on the same maps right after; None: none.
    version
        mapmeld's version and a fingerprint of its matchers' source.
    kind, env
        As the data set has them.
    true_overlap
        Overlap under the truth, 0..1; None for different places where none is stated.
    true_x, true_y, true_theta
        The truth ``T_a_b`` of the maps as they were given to the matcher [m, m, rad]; None for different
        places.
    verdict
        "accepted", "rejected", "ambiguous", or "error".
    reason
        The verdict in the method's own words, or what went wrong.
    x, y, theta
        The best guess ``T_a_b`` [m, m, rad]; None where the method has none.
    probability
        Stated probability that the guess is right; None: the method states none.
    similarity, overlap
        As in `mapmeld.MatchResult`.
    covariance
        Of (x, y, theta) [m, m, rad], nine numbers, row by row; None: the method gives none.
    alternatives
        How many other modes were given.
    translation_error, rotation_error
        See `mapmeld.evaluation.score.pose_errors` [m], [rad]; None without a truth or a guess.
    tolerance_translation, tolerance_rotation
        Errors up to which a guess counts as right [m], [rad].
    right
        Whether the guess is right, whatever the verdict.
    seconds
        Wall time of the match, maps loaded.
    against_seconds
        Wall time of `time_against`; None if it was not asked for or failed.
    """

    dataset: str
    pair: str
    inputs: str
    method: str
    parameters: str
    turn_seed: int | None
    swapped: bool
    time_against: str | None
    version: str
    kind: str
    env: str
    true_overlap: float | None
    true_x: float | None
    true_y: float | None
    true_theta: float | None
    verdict: str
    reason: str
    x: float | None = None
    y: float | None = None
    theta: float | None = None
    probability: float | None = None
    similarity: float = 0.0
    overlap: float = 0.0
    covariance: tuple[float, ...] | None = None
    alternatives: int = 0
    translation_error: float | None = None
    rotation_error: float | None = None
    tolerance_translation: float
    tolerance_rotation: float
    right: bool
    seconds: float
    against_seconds: float | None = None

    @property
    def key(self) -> TrialKey:
        """What was tried."""
        return (
            self.dataset,
            self.pair,
            self.inputs,
            self.method,
            self.parameters,
            self.turn_seed,
            self.swapped,
            self.time_against,
            self.version,
        )

    @property
    def score(self) -> float:
        """How sure the method is: its probability, or its similarity where it states none."""
        return self.similarity if self.probability is None else self.probability

    @property
    def time_ratio(self) -> float | None:
        """Its seconds / those of `time_against`."""
        return self.seconds / self.against_seconds if self.against_seconds else None


def is_right(errors: PoseErrors | None, tolerance: Tolerance) -> bool:
    """Report whether a guess with these errors is right; None (no truth, or no guess) never is."""
    return errors is not None and errors.within(tolerance)


def judged(row: TrialRow, tolerance: Tolerance) -> TrialRow:
    """Return the row as another tolerance sees it. Nothing has to be run again for that."""
    errors = None
    if row.translation_error is not None and row.rotation_error is not None:
        errors = PoseErrors(row.translation_error, row.rotation_error)
    return replace(
        row,
        tolerance_translation=tolerance.translation,
        tolerance_rotation=tolerance.rotation,
        right=is_right(errors, tolerance),
    )
