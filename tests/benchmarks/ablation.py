"""What each speed-up of the search buys and costs: the same search, with each switched off, for the same time.

`python -m tests.benchmarks.ablation [ARM ...] [--data FOLDER] [--minutes M] [--seeds N] [--folder RUNS]
[--fits]`. Its runs
are run directories: `gpsearch chart-search RUNS/*` draws them, and with more minutes they go on.

Searches take turns of some seconds on one core, so that whatever else a machine does hits all alike, and count the
seconds of their processor. With `--fits`, candidates of one search are fitted in every way instead.
"""

import multiprocessing
import os
import signal
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from statistics import median

import click
import numpy as np
import yaml

from fitters.engine.warm import warm_up
from gpsearch.configuration import Configuration, parse_configuration
from gpsearch.pictures.search_curves import Curve, SearchedRun, curves
from gpsearch.run import Store, WritableStore, open_run
from gpsearch.run.lock import RunLock
from gpsearch.run.store import FILE
from gpsearch.search.plan import plan
from gpsearch.search.search import Search
from tests.benchmarks import ablation_fits
from tests.benchmarks.arms import ARMS, Arm, substituted
from tests.benchmarks.problem import BUILT_IN, MEASURED, PROBE, data_folder
from tests.benchmarks.runs import Silent
from tests.benchmarks.table import Table
from workers import Job
from workers.context import context_of
from workers.local import LocalExecutor

MATERIALS = 2
SLICE_SECONDS = 4.0


@dataclass(frozen=True)
class Extent:
    """Sizes of the searches. A front begins with a generation, and on all cells a candidate takes seconds."""

    islands: int = 4
    size: int = 16
    scene: Mapping[str, int] = field(default_factory=dict)
    budget: Mapping[str, float | None] = field(default_factory=lambda: {"generations": None, "minutes": 1})


class TimedByItsProcessor(Search):
    """A search of which only the seconds count in which its process had a core, and which describes nothing."""

    def run(self) -> str:
        context_of(self.plan.recipe)
        self.started = time.process_time()
        return self._search()

    def seconds(self) -> float:
        return self.seconds_before + time.process_time() - self.started


class ConfirmingFirst(LocalExecutor):
    """What may enter the front does not wait for other islands' candidates: on all cells these take minutes."""

    def submit(self, job: Job) -> None:
        super().submit(job)
        if job.kind == "confirm":
            self._waiting.rotate(len(job.items))


def configured(arm: Arm, seed: int, data: Path | None, extent: Extent = Extent()) -> Configuration:
    """The configuration of an arm's run."""
    tree = {
        "name": arm.name,
        "seed": seed,
        "materials": list((MEASURED if data else BUILT_IN)[:MATERIALS]),
        "scene": {"light": PROBE if data else "studio", **extent.scene},
        "budget": dict(extent.budget),
        "search": {"islands": extent.islands, "island_size": extent.size},
        "fit": dict(arm.fit),
        "baselines": [],
    }
    return parse_configuration(yaml.safe_dump(tree), source=arm.name, folder=data or Path.cwd())


def run_arm(arm: Arm, configuration: Configuration, folder: Path) -> None:
    """Begins or goes on with an arm's run, in this process."""
    begun = (folder / FILE).exists()
    with RunLock(folder) as lock:
        store = WritableStore.of(lock) if begun else WritableStore.create(lock, configuration.text())
        with closing(store):
            with store.transaction():
                store.set_meta("configuration", configuration.text())
                store.set_meta("folder", str(configuration.folder.resolve()))
            with substituted(arm):
                TimedByItsProcessor(plan(configuration), store, ConfirmingFirst(), Silent()).run()


def in_turns(works: Mapping[str, Callable[[], None]], slice_seconds: float = SLICE_SECONDS) -> None:
    """Runs every work in a process of its own, one at a time, in slices. Raises `RuntimeError` where one fails."""
    forking = multiprocessing.get_context("fork")
    processes = [forking.Process(target=work, name=name, daemon=True) for name, work in works.items()]
    try:
        waiting = list(processes)
        while waiting:
            for process in list(waiting):
                if process.pid is None:
                    process.start()
                assert process.pid is not None
                os.kill(process.pid, signal.SIGCONT)
                process.join(slice_seconds)
                if process.exitcode is None:
                    os.kill(process.pid, signal.SIGSTOP)
                else:
                    waiting.remove(process)
    finally:
        for process in processes:
            if process.exitcode is None and process.pid is not None:
                process.kill()
    failed = [process.name for process in processes if process.exitcode]
    if failed:
        raise RuntimeError(f"failed, for the reasons above: {', '.join(failed)}")


def drawn(folders: Sequence[Path]) -> list[Curve]:
    """The curves of runs, without those that have no front yet."""
    runs = []
    for folder in folders:
        store, configuration = open_run(folder)
        if store.front().members:
            runs.append(SearchedRun.of(folder, store, configuration))
        store.close()
    return curves(runs) if runs else []


def judged(folder: Path) -> tuple[int, float]:
    """Candidates, those of a generation that was broken off too, and seconds of search."""
    store = Store.open(folder)
    reached = store.island_generations()
    whole = store.totals()[1]
    begun = sum(known.generation > reached[known.island] for _, known in store.fits())
    seconds = store.seconds
    store.close()
    return whole + begun, seconds


COLUMNS = (
    "search",
    "seconds",
    "candidates",
    "per second",
    "error at 1/4",
    "at 1/2",
    "at the end",
    "hypervolume",
    "s to full's",
    "times full's",
    "s to paper's",
    "paper's, times",
)


def table(folders: Mapping[str, Sequence[Path]]) -> Table:
    """A row per arm: medians over its runs, one a seed; what a run has not reached counts as never."""
    found = {curve.run: curve for curve in drawn([run for runs in folders.values() for run in runs])}
    by_arm = {arm: [found.get(run) for run in runs] for arm, runs in folders.items()}
    goals = {arm: _error(by_arm.get(arm, []), share) for arm, share in (("full", 0.5), ("paper", 1.0))}
    full = _reached(by_arm.get("full", []), goals["full"])
    rows = []
    for arm, runs in folders.items():
        counted = [judged(run) for run in runs]
        seconds = median(spent for _, spent in counted)
        errors = [_error(by_arm[arm], share) for share in (0.25, 0.5, 1.0)]
        to_full, to_paper = (_reached(by_arm[arm], goals[goal]) for goal in ("full", "paper"))
        row = (
            seconds,
            round(median(count for count, _ in counted)),
            median(count / spent for count, spent in counted),
            *errors,
            median(curve.steps[-1].hypervolume if curve else 0.0 for curve in by_arm[arm]),
            to_full,
            to_full / full,
            to_paper,
            _reached(by_arm.get("paper", []), goals["paper"]) / to_paper if np.isfinite(to_paper) else np.nan,
        )
        rows.append((arm, *(cell if np.isfinite(cell) else None for cell in row)))
    return Table(
        "The same search, with each speed-up off",
        COLUMNS,
        tuple(rows),
        (
            "error: the front's best, on all lit cells. seconds: of one core.",
            f"full's: to the error that `full` had after half its time, {goals['full']:.4f}.",
            f"paper's: to the error that `paper` had at its end, {goals['paper']:.4f}.",
            f"medians over {max(map(len, folders.values()))} seeds; -: not reached.",
        ),
    )


def _error(runs: Sequence[Curve | None], share: float) -> float:
    """The best error after a share of a run's time, infinite before there is one."""
    steps = [curve.at(share * curve.seconds) if curve else None for curve in runs]
    return median(step.error if step else np.inf for step in steps) if steps else np.nan


def _reached(runs: Sequence[Curve | None], error: float) -> float:
    """Seconds to an error, infinite where it was not reached."""
    times = [curve.first_below(error) if curve else None for curve in runs]
    return median(np.inf if time is None else time for time in times) if times else np.nan


@click.command()
@click.argument("arms", nargs=-1, type=click.Choice(list(ARMS)))
@click.option(
    "--data",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    default=data_folder,
    help="Folder with rgl/ and envmaps/; without one, built-in materials and light.",
)
@click.option("--minutes", type=click.FloatRange(0, min_open=True), default=1.0, help="Of a core, per run.")
@click.option("--seeds", type=click.IntRange(1), default=1, help="Runs per search.")
@click.option("--fits", is_flag=True, help="Fit candidates of one search in every way, instead.")
@click.option("--folder", type=click.Path(path_type=Path), help="Where the runs are kept; by default nowhere.")
def main(
    arms: tuple[str, ...], data: Path | None, minutes: float, seeds: int, fits: bool, folder: Path | None
) -> None:
    """Runs searches, by default all, for the same time, and prints what each has found."""
    if fits:
        short = Extent(size=32, budget={"generations": 4})
        configurations = {arm: configured(ARMS[arm], 1, data, short) for arm in arms or tuple(ARMS)}
        click.echo(ablation_fits.table(configurations).text())
        return
    with tempfile.TemporaryDirectory() as spare:
        place = folder or Path(spare)
        folders = {arm: [place / f"{arm}-{seed}" for seed in range(1, seeds + 1)] for arm in arms or tuple(ARMS)}
        warm_up()
        extent = Extent(budget={"generations": None, "minutes": minutes})
        works = {
            run.name: partial(run_arm, ARMS[arm], configured(ARMS[arm], seed, data, extent), run)
            for arm, runs in folders.items()
            for seed, run in enumerate(runs, start=1)
        }
        in_turns(works)
        click.echo(table(folders).text())


if __name__ == "__main__":
    main()
