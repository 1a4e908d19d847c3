import json
import math
from dataclasses import fields
from importlib.resources import files

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.matching import correlative
from mapmeld.matching.correlative.evidence import Evidence
from mapmeld.matching.correlative.matcher import Mode, mode_probabilities
from mapmeld.matching.correlative.probability import (
    USUAL_SURPLUS,
    ProbabilityModel,
    fitted_model,
    surplus_of_others,
)

NOTHING = ProbabilityModel(0.0, {})
scores = st.lists(st.floats(-800, 800), min_size=1, max_size=6)


@given(scores)
def test_probabilities_leave_room_for_none_of_them(of: list[float]) -> None:
    p = NOTHING.probabilities(of)
    assert p.shape == (len(of),)
    assert ((p >= 0) & (p <= 1)).all()
    assert p.sum() <= 1 + 1e-12
    if max(of) < 20:
        assert p.sum() < 1
    # The higher the score, the likelier.
    assert (np.diff(p[np.argsort(of)]) >= 0).all()


@given(st.floats(-5, 50), st.integers(1, 5))
def test_equals_share_the_probability(score: float, count: int) -> None:
    p = NOTHING.probabilities([score] * count)
    assert (p == p[0]).all()
    assert p.sum() == pytest.approx(count / (count + math.exp(-score)))


def test_one_mode_is_a_logistic() -> None:
    for score in (-3.0, 0.0, 2.0):
        assert NOTHING.probabilities([score])[0] == pytest.approx(1 / (1 + math.exp(-score)))
    assert NOTHING.probabilities([1000.0])[0] == 1
    assert NOTHING.probabilities([-1000.0])[0] == 0


def test_scores_are_weighted_figures() -> None:
    e = Evidence(100, 90, 95, 2, 1, 0.1, 0.6, 0.05, 0.5, 20, np.zeros(3))
    model = ProbabilityModel(-3.0, {"surplus": 0.5, "clean": 2.0})
    assert model.score(e) == pytest.approx(-3 + 0.5 * e.surplus + 2 * e.clean)
    assert ProbabilityModel(-3.0, {}).score(e) == -3


def test_what_is_shipped_is_a_model_of_figures_that_exist() -> None:
    raw = json.loads(files(correlative.__name__).joinpath("probability.json").read_text(encoding="utf-8"))
    model = fitted_model()
    assert model.bias == raw["bias"] < 0  # without evidence nothing is likely
    assert dict(model.weights) == raw["weights"]
    figures = {f.name for f in fields(Evidence)} | {
        n for n, v in vars(Evidence).items() if isinstance(v, property)
    }
    assert set(model.weights) <= figures
    assert all(weight >= 0 for weight in model.weights.values())
    assert any(weight > 0 for weight in model.weights.values())
    assert fitted_model() is model


def test_what_is_shipped_trusts_plenty_of_wall_and_not_a_little() -> None:
    def p(wall: float, explained: float, against: float) -> float:
        e = Evidence(
            wall, explained * wall, explained * wall, against * wall, against * wall,
            0.1, 0.6, 0.02, 0.7, wall / 4, np.zeros(3),
        )  # fmt: skip
        model = fitted_model()
        return float(mode_probabilities([Mode(np.zeros(3), e, model.score(e))], model)[0])

    assert p(200, 0.98, 0) > 0.95
    assert p(5, 1.0, 0) < 0.5
    assert p(200, 0.3, 0.2) < 0.05
    assert p(200, 0.8, 0.2) < 0.05  # no drift explains that
    assert p(200, 0.9, 0.02) < p(200, 0.95, 0.01) < p(400, 0.95, 0.01)


def test_what_others_reach_is_taken_off() -> None:
    def e(share: float) -> Evidence:
        return Evidence(
            100, 100 * share, 100 * share, 0, 0, 0.1, 0.6, 0.02, 0.7, 25, np.zeros(3)
        )  # fmt: skip

    modes = [e(0.9), e(0.5), e(0.3)]
    own = [mode.surplus for mode in modes]
    expected = [(own[1] + own[2]) / 2, (own[0] + own[2]) / 2, (own[0] + own[1]) / 2]
    assert surplus_of_others(modes, 3) == pytest.approx(expected)
    # What was not found counts as usual: a mode found alone is no better for it.
    assert surplus_of_others(modes, 5) == pytest.approx([(2 * e + 2 * USUAL_SURPLUS) / 4 for e in expected])
    assert surplus_of_others(modes[:1], 6) == pytest.approx([USUAL_SURPLUS])
    # The same best mode is worth less where the others come near to it.
    model = fitted_model()
    assert model.chance > 0

    def p(*shares: float) -> float:
        found = [Mode(np.zeros(3), e(share), model.score(e(share))) for share in shares]
        return float(mode_probabilities(found, model)[0])

    assert p(0.9, 0.3) > p(0.9, 0.5) > p(0.9, 0.7)
