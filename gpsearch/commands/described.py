"""The result of a run, its front described, culled and tested first where the run was stopped before that."""

from contextlib import closing
from pathlib import Path

import click
from rich.console import Console

from gpsearch.commands.progress import ProgressWatcher
from gpsearch.errors import GpsearchError
from gpsearch.run import Result, WritableStore, load_run, open_run
from gpsearch.run.lock import RunLock, holder
from gpsearch.search.plan import plan
from gpsearch.search.references import unfinished
from gpsearch.search.search import Search
from gpsearch.search.transfers import missing_transfers
from workers import LocalSettings, open_executor


def described(folder: Path) -> Result:
    """The result of a run directory.

    Describing what is missing writes to the run, which needs its lock. Where another process holds it, or the
    folder may not be written, the result is what is described so far, and standard error says so. Raises
    `GpsearchError` where there is no run.
    """
    if _is_whole(folder):
        return load_run(folder)
    try:
        lock = RunLock(folder)
    except GpsearchError:
        result, by = load_run(folder), holder(folder)
        reason = f"{by} writes to this run" if by else "the folder may not be written"
        advice = "; repeat this command when that process has ended" if by else ""
        click.echo(
            f"{folder}: {reason}: only what is described so far is reported, {len(result.formulas)} formulas of"
            f" the front without {result.missing} others{advice}",
            err=True,
        )
        return result
    with lock:
        _describe(lock)
    return load_run(folder)


def _is_whole(folder: Path) -> bool:
    store, configuration = open_run(folder)
    with closing(store):
        return not unfinished(store, store.front().members) and not missing_transfers(plan(configuration), store)


def _describe(lock: RunLock) -> None:
    planned = plan(load_run(lock.folder).source)
    console = Console(stderr=True, markup=False, emoji=False, highlight=False)
    with (
        closing(WritableStore.of(lock)) as store,
        open_executor(LocalSettings()) as executor,
        ProgressWatcher(console, planned.budget) as watcher,
    ):
        search = Search(planned, store, executor, watcher)
        search.describe_front()
        search.fit_test_materials()
