"""What is kept of each unit of work: flat rows of plain values, a JSON file each.

Times of computing are CPU seconds of one core. Poses are (x [m], y [m], theta [rad]).
"""

from __future__ import annotations

from dataclasses import dataclass

Numbers = tuple[float, float, float]
"""A pose."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EnvironmentRow:
    """An environment: its number from 1, seed, size [m], rooms, doors, furniture, floor [m^2], starts."""

    environment: int
    seed: int
    width: float
    height: float
    rooms: int
    doors: int
    furniture: int
    floor: float
    seconds: float


@dataclass(frozen=True, slots=True, kw_only=True)
class MappingRow:
    """One robot's mapping of an environment.

    Attributes
    ----------
    environment, mapping, seed
        Numbers from 1; seed of wheels, laser and SLAM.
    start
        T_world_map: where the robot was set down, which is where its map has its origin.
    duration, driven
        Of the tour [s, m].
    scans, used, states
        Scans taken, scans that SLAM used, states of the map that were kept.
    known_area
        Of the finished map [m^2].
    position_error, position_error_end
        Of SLAM's trajectory in the frame of its start: root mean square, and at the end [m].
    odometry_error_end
        Of odometry alone, at the end [m].
    accuracy
        Of the finished map (Equation 3).
    accuracy_over_time
        (time [s], accuracy) of states.
    simulation_seconds, slam_seconds, seconds
        Of computing; the last is all together, with writing.
    """

    environment: int
    mapping: int
    seed: int
    start: Numbers
    duration: float
    driven: float
    scans: int
    used: int
    states: int
    known_area: float
    position_error: float
    position_error_end: float
    odometry_error_end: float
    accuracy: float
    accuracy_over_time: tuple[tuple[float, float], ...]
    simulation_seconds: float
    slam_seconds: float
    seconds: float


@dataclass(frozen=True, slots=True, kw_only=True)
class MatchingRow:
    """Two mapping processes, matched state by state to their end.

    Attributes
    ----------
    environment, mapping_1, mapping_2, method, strategy
        What was matched, and how.
    steps
        States that were followed.
    truth, T_1_2
        True transform and the final best; None if there is none.
    true_overlap
        Area known in both finished maps / that of the smaller.
    right
        Success: within the tolerance of the truth.
    accepted
        Whether the method says that it may be believed.
    translation_error, rotation_error
        At the middle of the true overlap [m], and [rad].
    probability, similarity
        As stated for the final best.
    similarity_of_truth
        What the method's own measure says of the true transform.
    cause
        Of a failure, in words; empty for a success.
    accuracy
        Of the merged map (Equation 3); None without success.
    first_right
        From which time [s] on the best match was right until the end.
    over_time
        (time [s], right, accuracy of the merged map or None) while the maps grow.
    seconds
        Of computing, reading of the histories included.
    """

    environment: int
    mapping_1: int
    mapping_2: int
    method: str
    strategy: str
    steps: int
    truth: Numbers
    T_1_2: Numbers | None
    true_overlap: float
    right: bool
    accepted: bool
    translation_error: float | None
    rotation_error: float | None
    probability: float | None
    similarity: float
    similarity_of_truth: float
    cause: str
    accuracy: float | None
    first_right: float | None
    over_time: tuple[tuple[float, bool, float | None], ...]
    seconds: float


@dataclass(frozen=True, slots=True, kw_only=True)
class JoinRow:
    """A successful matching, matched further with the other mappings of its environment (Figure 9).

    Attributes
    ----------
    environment, mapping_1, mapping_2, method
        The successful matching.
    members, poses
        The mappings in the end result, in the order in which they were joined, and T_first_member of each.
    tried, right
        Further matchings that were tried, and that were right.
    accuracies
        Of the merged map with two, three, ... mappings.
    seconds
        Of computing.
    """

    environment: int
    mapping_1: int
    mapping_2: int
    method: str
    members: tuple[int, ...]
    poses: tuple[Numbers, ...]
    tried: int
    right: int
    accuracies: tuple[float, ...]
    seconds: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ElsewhereRow:
    """Finished maps of two different environments, matched: any accepted answer is wrong."""

    environment_1: int
    mapping_1: int
    environment_2: int
    mapping_2: int
    method: str
    accepted: bool
    probability: float | None
    similarity: float
    seconds: float


@dataclass(frozen=True, slots=True, kw_only=True)
class NavigabilityRow:
    """What ways planned on a map are worth (`mapmeld.evaluation.navigability`).

    Attributes
    ----------
    environment, members, method
        The mappings in the map; method is empty for a single mapping.
    problem
        Why no ways could be planned; empty if they could.
    pairs, reachable_map, reachable_truth, false_passages, false_blocks
        Counted over pairs of places.
    length_ratios
        Planned way / shortest true way.
    seconds
        Of computing.
    """

    environment: int
    members: tuple[int, ...]
    method: str
    problem: str
    pairs: int
    reachable_map: int
    reachable_truth: int
    false_passages: int
    false_blocks: int
    length_ratios: tuple[float, ...]
    seconds: float
