import math

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from mapmeld.se2 import Pose2

# Machines that run the tests are slow at times; time is measured in benchmarks/, not here.
settings.register_profile("mapmeld", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("mapmeld")

_metres = st.floats(-100, 100, allow_nan=False)
st.register_type_strategy(
    Pose2, st.builds(Pose2, _metres, _metres, st.floats(-math.pi, math.pi, allow_nan=False))
)
