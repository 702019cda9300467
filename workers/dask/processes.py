"""Worker processes of this machine, which live as long as the run that started them.

The terminal belongs to the launcher: Dask's log and Ctrl-C are kept away from it and from its worker processes.
"""

from __future__ import annotations

import logging
import os
import signal
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from multiprocessing import resource_tracker
from typing import Any

import dask.config
from dask.system import CPU_COUNT
from distributed import Client, LocalCluster, Nanny, Worker

from workers.errors import WorkersError

NOISY = ("distributed", "distributed.client", "distributed.gc", "asyncio", "tornado.application")
"""The loggers that distributed gives a level and a handler of their own, and those of its event loop."""

ONE_THREAD = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "NUMBA_NUM_THREADS": "1",
}
GRACE_SECONDS = 1.0
"""How long a process may take to end by itself before it is killed."""


class QuietWorker(Worker):
    """A worker that leaves the terminal to the process that started it."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        silence_logs()
        # Nor may what ends the process leave a stack there, nor anything that is written in compiled code.
        with open(os.devnull, "w") as nowhere:
            for stream in (1, 2):
                os.dup2(nowhere.fileno(), stream)
        super().__init__(*arguments, **options)


class QuietNanny(Nanny):
    """Keeps a `QuietWorker` alive in a process of its own."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **{"worker_class": QuietWorker, "env": ONE_THREAD, **options})

    async def kill(self, timeout: float = GRACE_SECONDS, reason: str = "nanny-kill") -> None:
        """Ends the process, even amid a task: a task is a pure function, so nothing is lost with it."""
        await super().kill(timeout=min(timeout, GRACE_SECONDS), reason=reason)


def start_processes(workers: int | None, wait_seconds: float, stack: ExitStack) -> Client:
    """A client of `workers` fresh processes of this machine (None: one per core); `stack` closes both.

    Each process has one thread and an equal share of the memory, and is restarted when it dies.
    """
    count = CPU_COUNT if workers is None else workers
    if count < 1:
        raise WorkersError(f"workers: {count} processes cannot do any work: ask for at least 1")
    stack.enter_context(silenced_logs())
    stack.enter_context(
        dask.config.set(
            {
                # The cluster would drop a process for good that is down when looked at some time after a death,
                # though it is only restarting once more.
                "distributed.deploy.lost-worker-timeout": "365 days",
            }
        )
    )
    try:
        with interrupts_kept_from_children():
            cluster = stack.enter_context(
                LocalCluster(
                    n_workers=count,
                    threads_per_worker=1,
                    worker_class=QuietNanny,
                    dashboard_address=None,
                    # Even without a dashboard a scheduler serves HTTP, and warns where its port is taken.
                    scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
                )
            )
            return stack.enter_context(Client(cluster, timeout=wait_seconds, set_as_default=False))
    except (OSError, RuntimeError) as error:
        raise WorkersError(f"{count} worker processes could not be started here: {error}") from error


def silence_logs() -> None:
    """Dask logs nothing in this process from now on."""
    for name in NOISY:
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)


@contextmanager
def silenced_logs() -> Iterator[None]:
    """Within it, Dask logs nothing in this process: what matters to a user is raised as `WorkersError`."""
    before = {name: logging.getLogger(name).level for name in NOISY}
    silence_logs()
    try:
        yield
    finally:
        for name, level in before.items():
            logging.getLogger(name).setLevel(level)


@contextmanager
def interrupts_kept_from_children() -> Iterator[None]:
    """Threads and processes started within it, and by these later, never see SIGINT.

    A terminal sends Ctrl-C to every process of its foreground group; only the launcher shall act on it, and
    stop its workers itself. A signal mask passes to children through fork and exec, so that not even a
    process that is still importing prints a traceback. The launcher gets its own Ctrl-C afterwards.
    """
    # It would be started by the first child, and let SIGINT through to the thread that starts it.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
