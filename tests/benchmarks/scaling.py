"""How a search scales with its workers: `python -m tests.benchmarks.scaling [SECTION ...] [--data FOLDER]`.

Real workers as far as this machine has cores; beyond, simulated ones that sleep as long as recorded fits took,
under a real launcher and a real scheduler.
"""

import os
import platform
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from statistics import fmean, median
from typing import Any
from unittest.mock import patch

import click
from distributed import Client

from fitters.engine.warm import warm_up
from fitters.fitting import ProblemRecipe
from gpsearch.evolution import island as evolution
from gpsearch.evolution.island import Island
from gpsearch.run.lock import RunLock
from gpsearch.search.plan import Plan
from tests.benchmarks import simulation
from tests.benchmarks.metering import (
    PARTS,
    Meter,
    MeteredExecutor,
    MeteredStore,
    Task,
    UndescribedSearch,
)
from tests.benchmarks.problem import data_folder, recipe
from tests.benchmarks.runs import plan
from tests.benchmarks.simulated_workers import simulated_workers
from tests.benchmarks.table import Table
from tests.workers.cluster import real_cluster
from workers import DaskSettings, Job, Recipe, open_executor
from workers.context import context_of

BREEDING = {
    "draft": "edits replayed",
    "random_edit": "edit drawn",
    "to_text": "text",
    "canonical": "canonical form",
}
"""What breeding a candidate consists of, by the function that does it."""

AIM = 1000
"""Cores that a search should keep busy."""


@dataclass(frozen=True)
class Size:
    """Of a search."""

    islands: int
    size: int
    generations: int

    def __str__(self) -> str:
        return f"{self.islands} x {self.size}"

    def plan(self, problem: ProblemRecipe) -> Plan:
        return plan(
            problem, islands=self.islands, size=self.size, generations=self.generations, early_stopping=True
        )


@dataclass(frozen=True)
class Extent:
    """Sizes of searches, and on how many workers each is run. The paper's has 4 islands of 1024.

    recorded:  the search whose fits are replaced by sleeps
    processes: of the simulated workers
    """

    real: Size = Size(4, 128, 4)
    real_workers: tuple[int, ...] = (1, 2)
    rounds: int = 3
    recorded: Size = Size(4, 64, 6)
    simulated: tuple[tuple[Size, tuple[int, ...]], ...] = (
        (Size(4, 1024, 3), (4, 16, 64, 256)),
        (Size(16, 1024, 2), (64, 256)),
    )
    processes: int = 2
    bred: Size = Size(1, 256, 100)


@dataclass(frozen=True)
class Measured:
    """A search by workers that have loaded what they need, from its first generation to its last.

    tasks: in seconds where they ran
    slept: what simulated fits should have taken, by job
    """

    workers: int
    seconds: float
    candidates: int
    fitted: int
    launcher: Mapping[str, float]
    others: Mapping[str, float]
    tasks: Sequence[Task]
    slept: Mapping[Job, Sequence[float]] = field(default_factory=dict)

    @property
    def rate(self) -> float:
        """Candidates per second."""
        return self.candidates / self.seconds

    @property
    def busy(self) -> float:
        """Seconds that tasks took."""
        return sum(task.seconds for task in self.tasks)

    @property
    def asleep(self) -> float:
        """Seconds that simulated fits should have taken."""
        return sum(map(sum, self.slept.values()))

    @property
    def share_busy(self) -> float:
        return self.busy / (self.workers * self.seconds)

    def launcher_seconds(self, part: str | None = None) -> float:
        """Of the processor, per candidate; of all parts by default."""
        total = sum(self.launcher.values()) if part is None else self.launcher[part]
        return total / self.candidates

    @property
    def scheduler_seconds(self) -> float:
        """Of the processor, per task."""
        return self.others["scheduler"] / len(self.tasks)

    @property
    def confirmed(self) -> int:
        return sum(len(seconds) for job, seconds in self.slept.items() if job.kind == "confirm")

    @property
    def task_seconds(self) -> float:
        return median(task.seconds for task in self.tasks)


# running


def run(
    planned: Plan,
    address: str,
    workers: int,
    processes: Mapping[str, Sequence[int]],
    recording: simulation.Recording | None = None,
) -> Measured:
    """A search on a cluster that is there; `processes` are ids by name, of what is to be metered."""
    meter = Meter(processes)
    with (
        tempfile.TemporaryDirectory() as folder,
        meter.attached(),
        open_executor(DaskSettings(scheduler=address)) as executor,
    ):
        store = MeteredStore.create(RunLock(Path(folder) / "run"), "")
        assert isinstance(store, MeteredStore)
        store.meter = meter
        UndescribedSearch(planned, store, MeteredExecutor(executor, meter), meter).run()
        _, candidates, fitted = store.totals()
        store.close()
    first, last = meter.readings[0], meter.readings[-1]
    slept: dict[Job, list[float]] = {}
    if recording is not None:
        for done in meter.results:
            slept.setdefault(done.job, []).append(recording.slept(done))
    return Measured(
        workers=workers,
        seconds=last.seconds - first.seconds,
        candidates=candidates,
        fitted=fitted,
        launcher={part: last.launcher[part] - first.launcher[part] for part in PARTS},
        others={name: last.others[name] - first.others[name] for name in last.others},
        tasks=meter.tasks,
        slept=slept,
    )


def _prepared(address: str, recipe: Recipe) -> dict[str, list[int]]:
    """Has the workers of a cluster on this machine load what they need; the ids of its processes."""
    with Client(address, set_as_default=False) as client:
        client.run(_load, recipe)
        workers = sorted(set(client.run(os.getpid).values()))
        return {"scheduler": [client.run_on_scheduler(os.getpid)], "workers": workers}


def _load(recipe: Recipe) -> None:
    context_of(recipe)


# real workers


def real(problem: ProblemRecipe, extent: Extent = Extent()) -> Iterator[Table]:
    """The same search on few and on more worker processes, in turns."""
    planned = extent.real.plan(problem)
    runs: dict[int, list[Measured]] = {count: [] for count in extent.real_workers}
    for _ in range(extent.rounds):
        for count, found in runs.items():
            with real_cluster(workers=count) as address:
                found.append(run(planned, address, count, _prepared(address, planned.recipe)))
    rates = {count: median(one.rate for one in found) for count, found in runs.items()}
    least = min(rates)
    yield Table(
        f"{extent.real} over {extent.real.generations} generations on real workers, "
        f"{os.cpu_count()} cores for all processes",
        (
            "workers",
            "candidates/s",
            "speed-up",
            "efficiency",
            "task, s",
            "busy",
            "workers' cores",
            "candidates per core second",
            "launcher",
            "scheduler",
        ),
        tuple(
            (
                count,
                rates[count],
                rates[count] / rates[least],
                _percent(rates[count] / rates[least] * least / count),
                median(one.task_seconds for one in found),
                _percent(median(one.share_busy for one in found)),
                median(one.others["workers"] / one.seconds for one in found),
                median(one.candidates / one.others["workers"] for one in found),
                _percent(median(one.launcher_seconds() * one.rate for one in found)),
                _percent(median(one.others["scheduler"] / one.seconds for one in found)),
            )
            for count, found in runs.items()
        ),
        (
            f"medians of {extent.rounds} runs each, in turns, by workers that have loaded the materials.",
            "task: median. busy: of the workers' time. workers' cores: that they got of this machine; where these",
            "are fewer than workers, launcher, scheduler or others on the machine had the rest.",
            "launcher, scheduler: of a core, beside the workers.",
        ),
    )


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"


# simulated workers


def simulated(problem: ProblemRecipe, extent: Extent = Extent()) -> Iterator[Table]:
    """Searches of several sizes on more and more simulated workers, and where what becomes the limit."""
    recording = simulation.record(extent.recorded.plan(problem))
    yield _recorded(recording, extent.recorded)
    measured: dict[Size, list[Measured]] = {}
    with tempfile.TemporaryDirectory() as folder:
        fits = simulation.save(recording, Path(folder) / "recording.json")
        for size, workers in extent.simulated:
            planned = simulation.SimulatedPlan.of(size.plan(problem), fits)
            measured[size] = [_simulated(planned, recording, count, extent.processes) for count in workers]
            yield _scaled(size, measured[size], extent.processes)
    yield _limits(measured)


def _simulated(planned: Plan, recording: simulation.Recording, workers: int, processes: int) -> Measured:
    with (
        real_cluster(workers=0) as address,
        simulated_workers(address, workers, processes),
        simulation.simulated(),
    ):
        return run(planned, address, workers, _prepared(address, planned.recipe), recording)


def _recorded(recording: simulation.Recording, size: Size) -> Table:
    kinds = {
        "screened, carried through": recording.carried_through,
        "screened, given up": recording.given_up,
        "confirmed": recording.confirmed,
    }
    return Table(
        f"Recorded: the fits of {size} over {size.generations} generations",
        ("kind", "fits", "median, ms", "mean, ms", "longest, ms"),
        tuple(
            (kind, len(seconds), 1e3 * median(seconds), 1e3 * fmean(seconds), 1e3 * max(seconds))
            for kind, seconds in kinds.items()
            if seconds
        ),
        ("seconds of a core, whatever else this machine did.",),
    )


def _scaled(size: Size, runs: Sequence[Measured], processes: int) -> Table:
    """A row per number of workers."""
    return Table(
        f"{size} over {size.generations} generations on simulated workers",
        (
            "workers",
            "candidates/s",
            "efficiency",
            "tasks/s",
            "task, s",
            "fitted",
            "confirmed",
            "launcher",
            *(f"{part}, us" for part in PARTS),
            "scheduler",
            "workers' processes",
            "overslept",
        ),
        tuple(
            (
                one.workers,
                one.rate,
                _percent(one.asleep / (one.workers * one.seconds)),
                len(one.tasks) / one.seconds,
                one.task_seconds,
                _percent(one.fitted / one.candidates),
                f"{100 * one.confirmed / one.candidates:.1f} %",
                _percent(one.launcher_seconds() * one.rate),
                *(1e6 * one.launcher_seconds(part) for part in PARTS),
                _percent(one.others["scheduler"] / one.seconds),
                _percent(one.others["workers"] / one.seconds / min(processes, one.workers)),
                _percent(max(0.0, one.busy / one.asleep - 1)),
            )
            for one in runs
        ),
        (
            "efficiency: of the rate at which so many workers would do nothing but the recorded fits.",
            "task: median. fitted, confirmed: of all candidates.",
            "us: of the launcher's core, per candidate.",
            f"launcher, scheduler, workers' processes ({processes} of them): of a core each.",
            "overslept: by how much longer tasks took than their fits should. Where that or the share of the",
            "workers' processes is high, or all shares together come near this machine's cores, the simulation",
            "itself is the limit.",
        ),
    )


def _limits(measured: Mapping[Size, Sequence[Measured]]) -> Table:
    """What each part of the machinery could do at most, by what it has cost."""
    rows = []
    for size, runs in measured.items():
        per_task = median(one.candidates / len(one.tasks) for one in runs)
        rates = {
            "launcher": 1 / median(one.launcher_seconds() for one in runs),
            "scheduler": per_task / median(one.scheduler_seconds for one in runs),
            "islands": median(size.islands * size.size / _longest(one) for one in runs),
        }
        for what, rate in rates.items():
            cores = rate * median(one.asleep / one.candidates for one in runs)
            rows.append((f"{size}: {what}", rate, rate / per_task, cores, f"{cores / AIM:.3f}"))
    return Table(
        "Where the limits lie",
        ("what", "candidates/s", "tasks/s", "cores kept busy", f"of {AIM}"),
        tuple(rows),
        (
            "launcher, scheduler: a process that has a core to itself and is never idle, at its median cost per",
            "candidate or task.",
            "islands: each waits for the longest fits of its generation; there are workers enough, and launcher",
            "and scheduler take no time.",
            "cores kept busy: at the recorded cost of a candidate, what is known already or given up included.",
        ),
    )


def _longest(one: Measured) -> float:
    """Mean seconds that an island waits for the longest fits of a generation."""
    waits: dict[str, float] = {}
    for job, seconds in one.slept.items():
        _, which = job.label.split(maxsplit=1)
        waits[which] = waits.get(which, 0.0) + max(seconds)
    return fmean(waits.values())


# breeding


def breeding(problem: ProblemRecipe, extent: Extent = Extent()) -> Iterator[Table]:
    """What the launcher's breeding takes, by generation: genomes grow by an edit in each."""
    planned = extent.bred.plan(problem)
    island, rows = Island(0), []
    for generation in range(1, extent.bred.generations + 1):
        clocks = dict.fromkeys(BREEDING, 0.0)
        began = time.thread_time()
        with ExitStack() as stack:
            for name in BREEDING:
                stack.enter_context(patch.object(evolution, name, _clocked(clocks, name)))
            brood = evolution.advance(island, planned.breeding, planned.seed)
        total = time.thread_time() - began
        if generation & (generation - 1) == 0 or generation == extent.bred.generations:
            rest = total - sum(clocks.values())
            nodes = fmean(child.nodes for child in brood)
            parts = (1e6 * seconds / len(brood) for seconds in (*clocks.values(), rest, total))
            rows.append((generation, nodes, *parts, len(brood) / total))
        errors = {child.expression: simulation.share(child.canonical.text, "error") for child in brood}
        island = evolution.survive(island, brood, errors)
    yield Table(
        f"Breeding an island of {extent.bred.size}: microseconds of a core per candidate",
        ("generation", "nodes", *BREEDING.values(), "rest", "all", "candidates/s"),
        tuple(rows),
        ("edits replayed: of a candidate's whole genome. Errors are random here: sizes differ from a search's.",),
    )


def _clocked(clocks: dict[str, float], name: str) -> Callable[..., Any]:
    function = getattr(evolution, name)

    def clocked(*arguments: Any) -> Any:
        began = time.thread_time()
        result = function(*arguments)
        clocks[name] += time.thread_time() - began
        return result

    return clocked


# command

SECTIONS: dict[str, Callable[[ProblemRecipe, Extent], Iterator[Table]]] = {
    "real": real,
    "simulated": simulated,
    "breeding": breeding,
}


@click.command()
@click.argument("sections", nargs=-1, type=click.Choice([*SECTIONS]))
@click.option(
    "--data",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    default=data_folder,
    help="Folder with rgl/ and envmaps/; without one, built-in materials and light.",
)
def main(sections: tuple[str, ...], data: Path | None) -> None:
    """Prints the tables of the named sections, by default of all."""
    warm_up()
    click.echo(f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}")
    for name in sections or SECTIONS:
        started = time.perf_counter()
        for table in SECTIONS[name](recipe(data), Extent()):
            click.echo(f"\n{table.text()}")
        load = ", ".join(f"{one:.1f}" for one in os.getloadavg())
        click.echo(f"\n{name}: {time.perf_counter() - started:.0f} s; load averages at its end: {load}")


if __name__ == "__main__":
    main()
