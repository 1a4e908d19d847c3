from __future__ import annotations

import math
import signal
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from mapmeld.se2 import Pose2

if TYPE_CHECKING:
    from mapmeld.experiment import Results

# Machines that run the tests are slow at times; time is measured in benchmarks/, not here.
settings.register_profile("mapmeld", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("mapmeld")

# What started the tests may ignore these (nohup, a shell's `&`), and programs under test would inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)
if hasattr(signal, "SIGHUP"):
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

_metres = st.floats(-100, 100, allow_nan=False)
st.register_type_strategy(
    Pose2, st.builds(Pose2, _metres, _metres, st.floats(-math.pi, math.pi, allow_nan=False))
)


@pytest.fixture(scope="session")
def small_experiment(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Results]:
    """The folder of a finished experiment, to be copied before anything is changed in it, and its results."""
    from small_experiment import SETTINGS

    from mapmeld.experiment import run_experiment

    root = tmp_path_factory.mktemp("experiment") / "small"
    return root, run_experiment(root, SETTINGS)
