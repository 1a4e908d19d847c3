"""Jobs on several processes or machines, behind one small interface: `run_jobs`."""

from mapmeld.parallel.jobs import Job, Shared, WorkerDiedError, run_jobs

__all__ = ["Job", "Shared", "WorkerDiedError", "run_jobs"]
