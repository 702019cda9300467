"""The console commands `dask-scheduler` and `dask-worker`, which distributed no longer installs itself."""

import os

from distributed.cli import dask_scheduler, dask_worker


def scheduler() -> None:
    """Starts a Dask scheduler with the options of `dask scheduler`."""
    dask_scheduler.main(prog_name="dask-scheduler")


def worker() -> None:
    """Starts Dask worker processes with the options of `dask worker`, but one thread in each by default.

    A fit keeps one core busy, and processes scale better than threads that share an interpreter: use a whole
    machine with `dask-worker ADDRESS --nworkers -1`, which starts one process per core.
    (`--nworkers auto` chooses the threads by itself, as Dask does.)
    """
    os.environ.setdefault("NUMBA_NUM_THREADS", "1")
    dask_worker.main(prog_name="dask-worker", default_map={"nthreads": 1})
