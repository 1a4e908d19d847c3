"""Any number of robots whose maps arrive while they map: the part that decides, without any middleware."""

from mapmeld.live.fleet import Fleet, FleetError, FleetSettings
from mapmeld.live.state import Decree, FleetState, PairReport, RobotReport

__all__ = ["Decree", "Fleet", "FleetError", "FleetSettings", "FleetState", "PairReport", "RobotReport"]
