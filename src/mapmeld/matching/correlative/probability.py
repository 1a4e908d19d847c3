"""The probability that a transform is right: what the paper leaves to future work (section 5)."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np

from mapmeld.matching.correlative.evidence import Evidence
from mapmeld.matching.correlative.wall_map import Doubles

USUAL_SURPLUS = 6.5  # of a mode that is not right: the median over the maps of the fit


@dataclass(frozen=True, slots=True)
class ProbabilityModel:
    """Conditional logit (McFadden 1974) over the modes of a pair of maps and "none of them".

    P(mode i is right) = exp(s_i) / (1 + sum_j exp(s_j)), s = bias + sum of weight x figure, so that
    modes which explain the maps equally well share the probability among them. What the others reach
    on average is what chance reaches with these two maps; the higher, the less s is worth.

    Attributes
    ----------
    bias
        Of s.
    weights
        By the name of a figure of `Evidence`.
    chance
        Weight of `surplus_of_others`, taken off s.
    """

    bias: float
    weights: Mapping[str, float]
    chance: float = 0.0

    def score(self, evidence: Evidence) -> float:
        """Return s of a mode if the others reached nothing."""
        return self.bias + sum(w * float(getattr(evidence, name)) for name, w in self.weights.items())

    def probabilities(self, scores: Sequence[float]) -> Doubles:
        """Return P of each mode; they sum to 1 less P(none of them)."""
        s = np.array([*scores, 0.0])
        p = np.exp(s - s.max())
        return np.asarray(p[:-1] / p.sum())


@cache
def fitted_model() -> ProbabilityModel:
    """Return the model with the coefficients that mapmeld ships (``probability.json``).

    `benchmarks/fit_probability.py` fits them; docs/methods.md says on which maps.
    """
    raw = json.loads(files(__package__).joinpath("probability.json").read_text(encoding="utf-8"))
    weights = {str(name): float(weight) for name, weight in raw["weights"].items()}
    return ProbabilityModel(float(raw["bias"]), weights, float(raw["chance"]))


def surplus_of_others(modes: Sequence[Evidence], looked_at: int) -> Doubles:
    """Return for each mode the mean surplus of the others; those missing of `looked_at` count as usual."""
    surplus = np.array([mode.surplus for mode in modes])
    count = max(looked_at, len(modes))
    missing = (count - len(modes)) * USUAL_SURPLUS
    return np.asarray((surplus.sum() - surplus + missing) / (count - 1))
