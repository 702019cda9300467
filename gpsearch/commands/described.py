"""The export of a run, its front described, culled and tested first where the run was stopped before that."""

from pathlib import Path
from typing import Any

from rich.console import Console

from gpsearch.commands.progress import ProgressWatcher
from gpsearch.commands.runs import open_run
from gpsearch.configuration import Configuration
from gpsearch.exports import front_json
from gpsearch.search.plan import plan
from gpsearch.search.references import unfinished
from gpsearch.search.search import Search
from gpsearch.search.transfers import transfer_lanes
from workers import LocalSettings, open_executor


def described(run: Path) -> tuple[dict[str, Any], Configuration]:
    """The export (gpsearch-front/1) of a run directory and its configuration. Raises `GpsearchError`."""
    store, configuration = open_run(run)
    try:
        planned = plan(configuration)
        if unfinished(store, store.front().members) or transfer_lanes(planned, store)[0]:
            console = Console(stderr=True, markup=False, emoji=False, highlight=False)
            with open_executor(LocalSettings()) as executor, ProgressWatcher(console, planned.budget) as watcher:
                search = Search(planned, store, executor, watcher)
                search.describe_front()
                search.fit_test_materials()
        return front_json(store, configuration), configuration
    finally:
        store.close()
