"""Every kind of executor keeps the contract: all that are registered, and a running cluster."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest

from tests.workers.cluster import real_cluster
from workers import EXECUTORS, DaskSettings, Executor, open_executor
from workers.testing.contract import ExecutorContract


@pytest.fixture(scope="module", params=[*EXECUTORS, "cluster"])
def settings(request: pytest.FixtureRequest) -> Iterator[Any]:
    if request.param == "cluster":
        with real_cluster(workers=2) as address:
            yield DaskSettings(address, hang_seconds=1.0)
    else:
        default: Any = EXECUTORS[request.param]()
        yield replace(default, hang_seconds=1.0) if hasattr(default, "hang_seconds") else default


@pytest.fixture(scope="module")
def executor(settings: Any) -> Iterator[Executor]:
    with open_executor(settings, package="gpsearch") as executor:
        yield executor


class TestExecutors(ExecutorContract):
    pass


def test_the_description_counts_the_workers(executor: Executor, settings: Any) -> None:
    if settings.kind == "local":
        assert executor.description == "this process"
    elif settings.kind == "dask" and settings.scheduler is None:
        plural = "es" * (executor.processes > 1)
        assert executor.description == f"{executor.processes} worker process{plural} on this machine"
    elif settings.kind == "dask":
        assert executor.description == f"{settings.scheduler} with 2 workers"
