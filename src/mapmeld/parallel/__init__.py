"""Jobs on several processes or machines, behind one small interface: `run_jobs`."""

from mapmeld.parallel.job import Job, Shared, WorkerDiedError
from mapmeld.parallel.jobs import run_jobs

__all__ = ["Job", "Shared", "WorkerDiedError", "run_jobs"]
