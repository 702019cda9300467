"""`gpsearch launch ARGUMENTS` beside a Dask scheduler whose workers are SLURM jobs.

There are as many jobs as there is work for; they are replaced before their time limit. SIGTERM is passed on to the
search, and the exit status is the search's. Adapt the constants to your site.
"""

import signal
import subprocess
import sys
from types import FrameType

from dask_jobqueue import SLURMCluster

PARTITION: str | None = None  # None: the site's default
ACCOUNT: str | None = None
PROCESSES = 16  # of one job, one core each
GIB_PER_PROCESS = 1.5  # a worker stays below 1 GiB; the rest is for the processes that supervise the workers
MINIMUM_JOBS = 1
MAXIMUM_JOBS = 16
WALLTIME = 240  # minutes, as are the next two
STAGGER = 10  # workers stop up to this much before or after the mean, not all at the same time
CLOSING = 10  # for the start of a job, and for the last task of a worker that stops
INTERVAL = 10  # seconds between looks at the workers
PORT = 8786  # as in search.yaml


def slurm_cluster() -> SLURMCluster:
    """A scheduler in this process, with no job submitted yet."""
    return SLURMCluster(
        queue=PARTITION,
        account=ACCOUNT,
        job_name="gpsearch-worker",
        cores=PROCESSES,
        processes=PROCESSES,
        memory=f"{PROCESSES * GIB_PER_PROCESS}GiB",
        walltime=str(WALLTIME),
        # A signal before the end, for a worker that exceeds its lifetime. Only the batch shell gets it, which
        # dask-worker therefore replaces (`exec` below).
        job_extra_directives=["--signal=B:TERM@60"],
        python=f"exec {sys.executable}",
        job_script_prologue=["export NUMBA_NUM_THREADS=1"],
        worker_extra_args=[
            "--lifetime",
            f"{WALLTIME - STAGGER - CLOSING}m",
            "--lifetime-stagger",
            f"{STAGGER}m",
            "--no-dashboard",
        ],
        scheduler_options={"port": PORT, "dashboard_address": ":0"},
    )


def give_up_departed(cluster: SLURMCluster, arrived: set[str]) -> None:
    """Forgets the jobs of `arrived` that have no worker left, so that other jobs replace them.

    dask-jobqueue goes on counting a job whose processes left at the end of their lifetime. `arrived` gains the
    jobs that have workers now.
    """
    workers = cluster.observed
    alive = {
        job
        for job, spec in cluster.worker_spec.items()
        if any(f"{job}{suffix}" in workers for suffix in spec.get("group", [""]))
    }
    if departed := (arrived - alive) & set(cluster.worker_spec):
        cluster.sync(cluster.scale_down, departed)
    arrived.update(alive)


def main(arguments: list[str]) -> int:
    with slurm_cluster() as cluster:
        # A job ends after a minute of too little work: longer than the end of a generation takes.
        cluster.adapt(
            minimum_jobs=MINIMUM_JOBS,
            maximum_jobs=MAXIMUM_JOBS,
            target_duration="1s",
            interval=f"{INTERVAL}s",
            wait_count=60 // INTERVAL,
        )
        search = subprocess.Popen(["gpsearch", "launch", *arguments])

        def pass_on(number: int, _frame: FrameType | None) -> None:
            search.send_signal(number)

        signal.signal(signal.SIGTERM, pass_on)
        arrived: set[str] = set()
        while (status := wait(search)) is None:
            give_up_departed(cluster, arrived)
    # The status that a shell gives for a program that a signal has killed.
    return status if status >= 0 else 128 - status


def wait(search: subprocess.Popen[bytes]) -> int | None:
    """The status of a search that ends within `INTERVAL`, else None."""
    try:
        return search.wait(INTERVAL)
    except subprocess.TimeoutExpired:
        return None


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
