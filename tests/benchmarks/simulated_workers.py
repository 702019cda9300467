"""Many Dask workers in few processes, for tasks that sleep."""

import asyncio
import multiprocessing
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.synchronize import Event

import dask.config
from distributed import Worker

from workers.dask.processes import silence_logs

PATIENCE_SECONDS = 120.0

CHEAP = {
    # Of a real worker, these cost its own process a little; here they would be added up.
    "distributed.worker.profile.enabled": False,
    "distributed.admin.system-monitor.interval": "60 s",
}


@contextmanager
def simulated_workers(address: str, count: int, processes: int) -> Iterator[None]:
    """Joins a scheduler with `count` workers of one thread each, without nannies."""
    spawn = multiprocessing.get_context("spawn")
    shares = [len(range(i, count, processes)) for i in range(min(processes, count))]
    started = []
    try:
        for share in shares:
            ready = spawn.Event()
            process = spawn.Process(target=_serve, args=(address, share, ready), daemon=True)
            process.start()
            started.append((process, ready))
        for _, ready in started:
            if not ready.wait(PATIENCE_SECONDS):
                raise RuntimeError(f"the simulated workers did not reach {address} in {PATIENCE_SECONDS:g} s")
        yield
    finally:
        for process, _ in started:
            process.terminate()
            process.join()


def _serve(address: str, count: int, ready: Event) -> None:
    silence_logs()
    with dask.config.set(CHEAP), tempfile.TemporaryDirectory() as scratch:
        asyncio.run(_work(address, count, scratch, ready))


async def _work(address: str, count: int, scratch: str, ready: Event) -> None:
    workers = [
        Worker(address, nthreads=1, memory_limit=0, dashboard_address="127.0.0.1:0", local_directory=scratch)
        for _ in range(count)
    ]
    await asyncio.gather(*workers)
    ready.set()
    await asyncio.gather(*(worker.finished() for worker in workers))
