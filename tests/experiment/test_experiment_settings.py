import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.experiment import ExperimentError, ExperimentSettings
from mapmeld.experiment.settings import strategy_of
from mapmeld.matching.match import UnknownMethodError


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"environments": 0}, "environments must be in 1..99, not 0"),
        ({"mappings": 1}, "mappings must be in 2..9, not 1"),
        ({"seed": -1}, "seed must be in 0..1000000, not -1"),
        ({"common": 0.5, "share": 0.4}, "common <= share <= 1 is needed, not common 0.5 and share 0.4"),
        ({"share": math.nan}, "share nan"),
        ({"methods": ()}, "at least one method"),
        ({"methods": ("alphabet", "alphabet")}, "there twice: alphabet, alphabet"),
    ],
)
def test_settings_out_of_range_are_refused(wrong: dict[str, object], said: str) -> None:
    with pytest.raises(ExperimentError, match=said):
        ExperimentSettings(**wrong)  # type: ignore[arg-type]


def test_a_method_that_does_not_exist_is_refused() -> None:
    with pytest.raises(UnknownMethodError, match="unknown method 'guess'"):
        ExperimentSettings(methods=("guess",))


def test_the_defaults_are_the_papers_size() -> None:
    s = ExperimentSettings()
    assert s.environments * s.mappings == 50
    assert s.environments * s.mappings * (s.mappings - 1) // 2 == 100
    assert [strategy_of(method) for method in s.methods] == ["paper", "evidence"]


@given(st.integers(0, 1000), st.integers(0, 1000))
def test_no_two_environments_or_mappings_share_a_seed(first: int, second: int) -> None:
    seeds = [
        (s.environment_seed(e), s.mapping_seed(e, m))
        for s in (ExperimentSettings(seed=seed) for seed in {first, second})
        for e in (1, 2, 99)
        for m in (1, 2, 9)
    ]
    assert len({mapping for _, mapping in seeds}) == len(seeds)
    assert len({environment for environment, _ in seeds}) == len(seeds) // 3


def test_all_settings_are_kept_as_json() -> None:
    kept = json.loads(json.dumps(ExperimentSettings(seed=3).as_json()))
    assert kept["seed"] == 3
    assert kept["slam"]["particles"] == 30
    assert kept["place"]["configuration"]["rooms"] == 10
    assert (kept["common"], kept["share"]) == (0.35, 0.65)
    assert kept["methods"] == {"alphabet": "paper", "correlative": "evidence"}
