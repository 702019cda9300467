"""The lock of a run directory: one process writes at a time.

The kernel holds it for the launcher's life and lets go of it however the launcher ends. What the file says only
serves messages.
"""

import errno
import fcntl
import json
import os
import socket
import time
from contextlib import suppress
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Self

from gpsearch import __version__
from gpsearch.errors import GpsearchError

FILE = "run.lock"

_TRIES, _PAUSE_SECONDS = 10, 0.03

_LARGEST = 10_000
"""Bytes that are read of a file."""
_UNSUPPORTED = (errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL)
"""What a file system without locks answers."""


@dataclass(frozen=True)
class Holder:
    """Who holds a lock, or held it when it died; `started` in ISO 8601, UTC."""

    host: str
    pid: int
    started: str
    version: str

    def __str__(self) -> str:
        return f"process {self.pid} on {self.host} since {self.started}"


def holder(folder: Path) -> Holder | None:
    """Who runs in a run directory now."""
    try:
        with (folder / FILE).open() as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return _read_holder((folder / FILE).read_bytes())
    except OSError:
        pass
    return None


def _read_holder(text: bytes) -> Holder | None:
    """Whom a lock's file names, if it does: it may be incomplete after a loss of power, or not yet written."""
    try:
        named = json.loads(text)
        return Holder(str(named["host"]), int(named["pid"]), str(named["started"]), str(named["version"]))
    except (ValueError, TypeError, KeyError, RecursionError):
        return None


class RunLock:
    """The lock of a run directory, from when it is made until `release` or the end of the process.

    The processes that the launcher starts do not hold it with it, so that they cannot keep it beyond its end; this
    is so for all that exec, not for those that only fork.
    """

    taken_over_from: Holder | None
    """The launcher that held it last and died; None where the last one ended cleanly or left no readable name."""

    def __init__(self, folder: Path) -> None:
        """Makes the folder where it is missing. Raises `GpsearchError` where another launcher holds the lock."""
        self.folder = folder
        self._path = folder / FILE
        try:
            folder.mkdir(parents=True, exist_ok=True)
            # Python opens files so that exec closes them. A link could name a file that is not ours to empty.
            self._descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644)
        except OSError as error:
            raise GpsearchError(
                f"{self._path}: the run cannot be locked there ({error.strerror}); choose another --run"
            ) from None
        try:
            self._lock(folder)
            self.taken_over_from = self._read()
            self._write(_ourselves())
        except BaseException:
            os.close(self._descriptor)
            raise

    def _lock(self, folder: Path) -> None:
        try:
            self._try_for_a_moment()
        except BlockingIOError:
            holder = self._read()
            who = f" ({holder})" if holder else ""
            raise GpsearchError(
                f"{folder}: another gpsearch writes to this run{who}; "
                "wait for it or stop it, or name another directory with --run"
            ) from None
        except OSError as error:
            advice = "choose another --run"
            if error.errno in _UNSUPPORTED:
                advice = "its file system has no locks, choose a directory on a local disk with --run"
            raise GpsearchError(f"{folder}: the run cannot be locked ({error.strerror}); {advice}") from None

    def _try_for_a_moment(self) -> None:
        """`status` holds the lock, too, for the moment in which it looks whether anyone does."""
        for _ in range(_TRIES - 1):
            with suppress(BlockingIOError):
                fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                return
            time.sleep(_PAUSE_SECONDS)
        fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)

    def _read(self) -> Holder | None:
        try:
            return _read_holder(os.pread(self._descriptor, _LARGEST, 0))
        except OSError:
            return None

    def _write(self, holder: Holder) -> None:
        try:
            os.ftruncate(self._descriptor, 0)
            os.pwrite(self._descriptor, (json.dumps(asdict(holder)) + "\n").encode(), 0)
        except OSError as error:
            raise GpsearchError(
                f"{self._path}: cannot be written ({error.strerror}); make room there, or choose another --run"
            ) from None

    @property
    def held(self) -> bool:
        """Whether it was not released yet."""
        return self._descriptor >= 0

    def release(self) -> None:
        """Lets others have the lock; the empty file that stays says that the run ended cleanly."""
        if self._descriptor < 0:
            return
        descriptor, self._descriptor = self._descriptor, -1
        with suppress(OSError):
            os.ftruncate(descriptor, 0)
        os.close(descriptor)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()


def _ourselves() -> Holder:
    started = datetime.now(UTC).isoformat(timespec="seconds")
    return Holder(socket.gethostname(), os.getpid(), started, __version__)
