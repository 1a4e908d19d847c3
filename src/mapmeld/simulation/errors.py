"""What can go wrong in a simulation."""

from mapmeld.errors import MapmeldError


class SimulationError(MapmeldError):
    """An environment, a robot or a drive that cannot be as asked."""
