"""A job, and what is the same wherever it runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from mapmeld.errors import MapmeldError

Job = tuple[Any, ...]
"""The arguments of one call. A `Shared` among them stands for an object that is sent ahead."""

RESTARTS = 2
"""How often what a lost worker had not finished is given to others."""


class WorkerDiedError(MapmeldError):
    """Workers ended unexpectedly, again and again."""


@dataclass(frozen=True, slots=True)
class Shared:
    """Stands, in a job, for the object of that number among those that every worker is sent once."""

    number: int


def filled(job: Job, shared: Sequence[object]) -> Job:
    """Return the job with the shared objects in their places."""
    return tuple(shared[part.number] if isinstance(part, Shared) else part for part in job)
