"""Where an executor runs its work."""

from __future__ import annotations

from dataclasses import dataclass

from workers.errors import WorkersError
from workers.tls import Tls


@dataclass(frozen=True)
class LocalSettings:
    """Run in this process, one task after the other."""


@dataclass(frozen=True)
class DaskSettings:
    """Run on a Dask cluster: a running one, or worker processes of this machine."""

    scheduler: str | None = None
    """`tcp://HOST:PORT` or `tls://HOST:PORT` of a running scheduler; None starts processes on this machine."""
    workers: int | None = None
    """How many processes to start where `scheduler` is None; None is one per core."""
    wait_seconds: float = 60.0
    """How long to wait for the scheduler and a first worker; they may be away for so long later on, too."""
    hang_seconds: float = 60.0
    """What takes longer than this, and 30 times what it should, is taken to hang."""
    tls: Tls | None = None
    """What a `tls://` scheduler takes, and no other."""

    def __post_init__(self) -> None:
        encrypted = self.scheduler is not None and self.scheduler.startswith("tls://")
        if encrypted and self.tls is None:
            raise WorkersError(f"{self.scheduler} needs the files ca, cert and key: name them under tls")
        if self.tls is not None and not encrypted:
            raise WorkersError("tls is for a scheduler at tls://HOST:PORT: name one, or leave out tls")


Settings = LocalSettings | DaskSettings
