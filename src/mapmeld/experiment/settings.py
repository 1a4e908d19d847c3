"""What an experiment is made with: few choices, and what stays the same in all of them."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field

from mapmeld.errors import MapmeldError
from mapmeld.evaluation.score import Tolerance
from mapmeld.matching.match import method_named
from mapmeld.simulation.generator import Settings
from mapmeld.simulation.tour import COMMON, SHARE
from mapmeld.slam.parameters import GMappingParameters

PAPER_METHOD = "alphabet"
OWN_STRATEGY = {"correlative": "evidence"}
"""The default method comes with its own strategy; all others are run by the paper's Algorithm 1."""

SLAM = GMappingParameters(lskip=1)
"""The defaults of the ROS node, but for the beams: every other one is matched (the map gets all)."""

TOLERANCE = Tolerance()
"""What counts as success, at the middle of the true overlap."""

LONGEST_TOUR = 900.0
"""[s]"""

SAMPLE_SECONDS = 5.0
"""How often accuracy is measured while maps grow [s]."""

ROBOT_RADIUS = 0.2
"""Of the robot that ways are planned for [m]."""

PLANNED_PAIRS = 50
"""Pairs of places between which ways are planned, on each map."""

MAX_ENVIRONMENTS, MAX_MAPPINGS = 99, 9


class ExperimentError(MapmeldError):
    """An experiment that cannot be made, or gone on with, as asked."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExperimentSettings:
    """What to do; the defaults are the paper's.

    Attributes
    ----------
    environments
        How many are drawn.
    mappings
        Of each environment; all pairs of them are matched.
    seed
        Of all randomness.
    methods
        How to match, each a method of `mapmeld.match`. ``correlative`` runs with its own strategy (evidence
        over time), all others by Algorithm 1.
    place
        What kind of environments.
    common, share
        Parts of the floor that all mappings of an environment, and that each single one, drive through at
        least, 0 to 1.
    slam
        How maps are made of scans.

    Raises
    ------
    ExperimentError
        A number out of range, or a method twice.
    UnknownMethodError
        There is no such method.
    """

    environments: int = 10
    mappings: int = 5
    seed: int = 0
    methods: tuple[str, ...] = (PAPER_METHOD, "correlative")
    place: Settings = field(default_factory=Settings)
    common: float = COMMON
    share: float = SHARE
    slam: GMappingParameters = SLAM

    def __post_init__(self) -> None:
        for name, value, low, high in (
            ("environments", self.environments, 1, MAX_ENVIRONMENTS),
            ("mappings", self.mappings, 2, MAX_MAPPINGS),
            ("seed", self.seed, 0, 1_000_000),
        ):
            if not low <= value <= high:
                raise ExperimentError(f"{name} must be in {low}..{high}, not {value}")
        if not 0 <= self.common <= self.share <= 1:
            raise ExperimentError(
                f"0 <= common <= share <= 1 is needed, not common {self.common:g} and share {self.share:g}"
            )
        if not self.methods:
            raise ExperimentError("at least one method is needed")
        for name in self.methods:
            method_named(name)
        if len(set(self.methods)) < len(self.methods):
            raise ExperimentError(f"a method is there twice: {', '.join(self.methods)}")

    def environment_seed(self, environment: int) -> int:
        """Return the seed of an environment (counted from 1), as `mapmeld environment --seed` takes it."""
        return self.seed * 100 + environment - 1

    def mapping_seed(self, environment: int, mapping: int) -> int:
        """Return the seed of a mapping (counted from 1): of wheels, laser and SLAM, as `mapmeld simulate`."""
        return self.environment_seed(environment) * 1000 + mapping - 1

    def as_json(self) -> dict[str, object]:
        """Return all settings in plain types, those included that are the same in every experiment."""
        place = asdict(self.place)
        place["configuration"]["room_types"] = [list(sides) for sides in self.place.configuration.room_types]
        return {
            "environments": self.environments,
            "mappings": self.mappings,
            "seed": self.seed,
            "methods": {name: strategy_of(name) for name in self.methods},
            "place": place,
            "common": self.common,
            "share": self.share,
            "slam": asdict(self.slam),
            "tolerance": str(TOLERANCE),
            "sample_seconds": SAMPLE_SECONDS,
            "robot_radius": ROBOT_RADIUS,
            "planned_pairs": PLANNED_PAIRS,
        }


def strategy_of(method: str) -> str:
    """Return the strategy that follows two histories with a method."""
    return OWN_STRATEGY.get(method, "paper")
