"""What early stopping gives up: its rule applied to every candidate of a run that was recorded without it."""

import math
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from fitters.fits import Candidate, Fit, FitProblem, ProblemRecipe, build_problem, screen
from gpsearch.front import Store
from gpsearch.search.entrants import Entrant
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


class Recorded(Search):
    """A search without early stopping that notes the bar which each candidate would have had."""

    def __init__(self, *arguments: object) -> None:
        super().__init__(*arguments)
        self.candidates_seen: dict[str, Candidate] = {}
        self.entered: set[str] = set()

    def _candidate(self, entrant: Entrant) -> Candidate:
        candidate = super()._candidate(entrant)
        bar = max(self.better_third, self.front.bar(entrant.nodes)) if self.generation else math.inf
        self.candidates_seen[candidate.expression] = replace(candidate, bar=bar)
        return candidate

    def _one_generation(self) -> bool:
        whole = super()._one_generation()
        self.entered |= {self.memory.form(member.expression).text for member in self.front.members}
        return whole


def tables(recipe: ProblemRecipe, extent: Extent = Extent()) -> Iterator[Table]:
    """How many fits are given up, what they would have become, and whether a member of any front is among them."""
    planned = plan(
        recipe,
        islands=extent.islands,
        size=extent.size,
        generations=extent.generations,
        early_stopping=False,
    )
    with tempfile.TemporaryDirectory() as folder:
        store = Store.create(Path(folder) / "run", "")
        search = Recorded(planned, store, LocalExecutor(), Silent())
        search.run()
        store.close()
    problem = build_problem(recipe)
    judged = [c for c in search.candidates_seen.values() if math.isfinite(c.bar)]
    carried, plain_seconds = _screened(problem, search, [replace(c, bar=math.inf) for c in judged])
    stopped, seconds = _screened(problem, search, judged)
    given_up = [i for i, fit in enumerate(stopped) if not fit.finished]
    below = [i for i in given_up if carried[i].error < judged[i].bar]
    lost = [i for i in given_up if judged[i].expression in search.entered]
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
                plain_seconds / seconds,
            ),
        ),
        (
            "front members: of any generation's front. lost: those whose fit the rule would have given up.",
            "time ratio: of the same fits without the rule to those with it.",
        ),
    )


def _screened(problem: FitProblem, search: Search, candidates: list[Candidate]) -> tuple[list[Fit], float]:
    job = search.plan.screening(*candidates)
    started = time.perf_counter()
    return screen(problem, job), time.perf_counter() - started
