"""SIGTERM, which ends a run as cleanly as Ctrl-C does."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class Terminated(BaseException):
    """The process was asked to end. Like KeyboardInterrupt, no handler of errors may catch it by chance."""


@contextmanager
def terminable() -> Iterator[None]:
    """Within it SIGTERM raises `Terminated`, once: another one does not disturb what is being written down."""

    def terminate(number: int, frame: FrameType | None) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        raise Terminated

    before = signal.signal(signal.SIGTERM, terminate)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
