"""What early stopping gives up: its rule applied to every candidate of a run that was recorded without it."""

import math
import tempfile
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from fitters.expressions import parse
from fitters.expressions.canonical import canonical
from fitters.fitting import Candidate, Fit, Problem, ProblemRecipe
from gpsearch.evolution.island import Island, Offspring
from gpsearch.run import Generation, Member, WritableStore
from gpsearch.run.lock import RunLock
from gpsearch.search.island_search import IslandSearch
from gpsearch.search.plan import Plan
from gpsearch.search.search import Search
from tests.benchmarks.runs import Silent, plan
from tests.benchmarks.table import Table
from workers.local import LocalExecutor


@dataclass(frozen=True)
class Extent:
    """Sizes of the recorded search."""

    generations: int = 8
    islands: int = 4
    size: int = 64


class RecordedIslandSearch(IslandSearch):
    """Gives no fit up, and records every candidate with the bar that it would have had."""

    recorded: list[Candidate]

    def _bar(self, nodes: int) -> float:
        return math.inf

    def _screen_job(self, candidate: Offspring) -> Candidate:
        job = super()._screen_job(candidate)
        self.recorded.append(replace(job, bar=super()._bar(candidate.nodes)))
        return job


class RecordedSearch(Search):
    """A search without early stopping.

    recorded: what was screened, in canonical form; what several islands had screened occurs as often
    entered:  canonical forms of what was on the front of any generation of an island
    """

    def __init__(self, *arguments: object) -> None:
        self.recorded: list[Candidate] = []
        self.entered: set[str] = set()
        super().__init__(*arguments)

    def _island_search(self, island: Island) -> IslandSearch:
        search = RecordedIslandSearch(
            self.plan, self.store, island, self.shared, on_generation=self._on_generation, seconds=self.seconds
        )
        search.recorded = self.recorded
        return search

    def _on_generation(self, row: Generation, screened: int, confirmed: list[Member]) -> None:
        super()._on_generation(row, screened, confirmed)
        members = {member.expression for member in self.front.members}
        self.entered |= {canonical(parse(m.expression)).text for m in confirmed if m.expression in members}


def tables(recipe: ProblemRecipe, extent: Extent = Extent()) -> Iterator[Table]:
    """How many fits are given up, what they would have become, and whether a member of any front is among them."""
    planned = plan(
        recipe,
        islands=extent.islands,
        size=extent.size,
        generations=extent.generations,
        early_stopping=True,
    )
    with tempfile.TemporaryDirectory() as folder:
        store = WritableStore.create(RunLock(Path(folder) / "run"), "")
        search = RecordedSearch(planned, store, LocalExecutor(), Silent())
        search.run()
        store.close()
    judged = [candidate for candidate in search.recorded if math.isfinite(candidate.bar)]
    carried, stopped, ratio = _screened_in_turns(recipe.build(), planned, judged)
    given_up = [i for i, fit in enumerate(stopped) if not fit.finished]
    below = [i for i in given_up if carried[i].error < judged[i].bar]
    # What one island gives up may be what another carries through.
    kept = {one.expression for one in search.recorded if math.isinf(one.bar)}
    kept |= {one.expression for one, fit in zip(judged, stopped, strict=True) if fit.finished}
    lost = search.entered - kept
    yield Table(
        f"Early stopping on a recorded run, {extent.generations} generations of {extent.islands} x {extent.size}",
        ("candidates with a bar", "given up", "would have passed the bar", "front members", "lost", "time ratio"),
        (
            (
                len(judged),
                f"{100 * len(given_up) / max(len(judged), 1):.0f} %",
                len(below),
                len(search.entered),
                len(lost),
                ratio,
            ),
        ),
        (
            "front members: of any generation's front. lost: those whose fit the rule would have given up.",
            "time ratio: of the same fits without the rule to those with it.",
        ),
    )


def _screened_in_turns(
    problem: Problem, planned: Plan, candidates: Iterable[Candidate]
) -> tuple[list[Fit], list[Fit], float]:
    """The fits without a bar, those with it, and the ratio of the times that these took."""
    fits: tuple[list[Fit], list[Fit]] = ([], [])
    seconds = [0.0, 0.0]
    for candidate in candidates:
        for i, one in enumerate((replace(candidate, bar=math.inf), candidate)):
            started = time.perf_counter()
            fits[i].append(planned.screen(problem, one))
            seconds[i] += time.perf_counter() - started
    return *fits, seconds[0] / seconds[1] if candidates else 1.0
