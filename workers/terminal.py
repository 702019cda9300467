"""Keeps a launcher's terminal to the launcher: Dask's log and Ctrl-C stay out of its worker processes."""

from __future__ import annotations

import logging
import signal
from collections.abc import Iterator
from contextlib import contextmanager

NOISY = ("distributed", "distributed.client", "distributed.gc", "asyncio", "tornado.application")
"""The loggers that distributed gives a level and a handler of their own, and those of its event loop."""


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
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
