"""How to run on a Dask cluster."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from workers.dask.tls import Tls
from workers.errors import WorkersError

if TYPE_CHECKING:
    from workers.dask.executor import DaskExecutor


@dataclass(frozen=True)
class DaskSettings:
    """Run on a Dask cluster: a running one, or worker processes of this machine."""

    kind: ClassVar[str] = "dask"

    scheduler: str | None = None
    """`tcp://HOST:PORT` or `tls://HOST:PORT` of a running scheduler; None starts processes on this machine."""
    workers: int | None = None
    """How many processes to start where `scheduler` is None; None is one per core."""
    wait_seconds: float = 60.0
    """How long to wait for the scheduler and a first worker, at the start and whenever they are away later."""
    hang_seconds: float = 60.0
    """What takes longer than this, and 30 times what it should, counts as hanging."""
    tls: Tls | None = None
    """The files for a `tls://` scheduler, and for no other."""

    def __post_init__(self) -> None:
        encrypted = self.scheduler is not None and self.scheduler.startswith("tls://")
        if encrypted and self.tls is None:
            raise WorkersError(f"{self.scheduler} needs the files ca, cert and key: name them under tls")
        if self.tls is not None and not encrypted:
            raise WorkersError("tls is for a scheduler at tls://HOST:PORT: name one, or leave out tls")

    def open(self, package: str | None) -> DaskExecutor:
        """See `ExecutorSettings.open`. Imports distributed, which takes most of a second, only here."""
        from workers.dask.executor import DaskExecutor

        return DaskExecutor(self, package)
