"""Reaching a Dask cluster, and making sure that it can do the work."""

from __future__ import annotations

import asyncio
import importlib.metadata
import re
from contextlib import ExitStack
from dataclasses import dataclass
from time import monotonic

from distributed import Client, Security
from distributed.comm import connect as open_comm

from workers.dask.processes import silenced_logs
from workers.dask.tls import OPTIONS, Tls, check_files, expects_tls, trouble
from workers.errors import WorkersError

ANSWER_SECONDS = 10.0
"""How long a worker may take to say which version it has: a frozen one never does."""

ADDRESS = re.compile(r"(tcp|tls)://(\[[0-9a-fA-F:.]+\]|[^\s:/\[\]]+):(?P<port>\d{1,5})")


@dataclass(frozen=True)
class Package:
    """A distribution that must have the same version wherever the work runs."""

    name: str
    version: str

    def fault(self, version: str | BaseException) -> str:
        """What is wrong with an answer to which version there is; empty where it is ours."""
        if isinstance(version, importlib.metadata.PackageNotFoundError):
            return f"has no {self.name}: install {self.name} {self.version} there"
        if isinstance(version, BaseException):
            return f"cannot say which {self.name} it has: {version}"
        if version != self.version:
            here = f"this process {self.version}"
            return f"has {self.name} {version}, {here}: install the same version on both"
        return ""


def connect(address: str, wait_seconds: float, stack: ExitStack, tls: Tls | None = None) -> Client:
    """A client of the scheduler at `address`, which has at least one worker; `stack` closes it.

    Raises `WorkersError` for a malformed address, where scheduler or worker stay away for `wait_seconds`, or
    where `tls` does not fit the scheduler.
    """
    match = ADDRESS.fullmatch(address)
    if match is None or not 0 < int(match["port"]) < 65536:
        raise WorkersError(
            f"{address!r} is not the address of a Dask scheduler: "
            "write tcp://HOST:PORT, such as tcp://127.0.0.1:8786"
        )
    stack.enter_context(silenced_logs())
    deadline = monotonic() + wait_seconds
    security = _security(address, wait_seconds, tls)
    options = f" {OPTIONS}" if tls else ""
    try:
        left = max(0.1, deadline - monotonic())
        asyncio.run(asyncio.wait_for(_shake_hands(address, left, security), left))
        client = Client(address, timeout=wait_seconds, set_as_default=False, security=security)
        stack.callback(client.close)
    except (OSError, ValueError) as error:
        if tls is None and expects_tls(address, deadline - monotonic()):
            raise WorkersError(
                f"the Dask scheduler at {address} expects TLS: "
                "write tls:// and name the files ca, cert and key under tls"
            ) from error
        raise WorkersError(
            f"no Dask scheduler answers at {address} after {wait_seconds:g} s: "
            f"start one with `dask-scheduler{options}`, or set executor: local"
        ) from error
    except (ImportError, RuntimeError) as error:
        raise WorkersError(f"cannot speak with the Dask scheduler at {address}: {error}") from error
    try:
        client.wait_for_workers(1, timeout=max(0.1, deadline - monotonic()))
    except TimeoutError as error:
        raise WorkersError(
            f"the Dask scheduler at {address} has no workers after {wait_seconds:g} s: "
            f"start some with `dask-worker {address}{options}`"
        ) from error
    except OSError as error:
        raise WorkersError(
            f"the Dask scheduler at {address} went away while we waited for workers: {error}"
        ) from error
    return client


def _security(address: str, wait_seconds: float, tls: Tls | None) -> Security:
    """What Dask takes for `tls`. Raises `WorkersError` where the files or the scheduler's do not fit."""
    if tls is None:
        return Security()
    check_files(tls)
    security = Security(
        tls_ca_file=str(tls.ca),
        tls_client_cert=str(tls.cert),
        tls_client_key=str(tls.key),
        require_encryption=True,
    )
    # Dask would repeat for all the time what cannot work, and not say why.
    context = security.get_connection_args("client")["ssl_context"]
    if reason := trouble(address, tls, context, wait_seconds / 2):
        raise WorkersError(reason)
    return security


async def _shake_hands(address: str, wait_seconds: float, security: Security) -> None:
    """Returns once a Dask process answers: a client alone would wait for ever where another server listens."""
    comm = await open_comm(address, timeout=wait_seconds, **security.get_connection_args("client"))
    comm.abort()


async def faults_of_workers(
    client: Client, package: Package | None, workers: list[str] | None = None
) -> dict[str, str]:
    """What is wrong on those workers that have another version of `package`, by address.

    Asks by a function of the standard library, since it must be found where our package is not. Where a worker
    does not answer in time, none is named: the first task that one of them gets will tell.
    """
    if package is None:
        return {}
    question = client.run(importlib.metadata.version, package.name, workers=workers, on_error="return")
    try:
        answers = await asyncio.wait_for(question, ANSWER_SECONDS)
    except TimeoutError:
        return {}
    faults = {address: package.fault(answer) for address, answer in answers.items()}
    return {address: text for address, text in faults.items() if text}


async def fault_of_scheduler(client: Client, package: Package | None) -> str:
    """What is wrong with the scheduler's version of `package`; empty where it is ours."""
    if package is None:
        return ""
    question = client.run_on_scheduler(importlib.metadata.version, package.name)
    try:
        return package.fault(await asyncio.wait_for(question, ANSWER_SECONDS))
    except Exception as error:
        return package.fault(error)
