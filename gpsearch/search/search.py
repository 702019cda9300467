"""The search: breeds, has fits computed, selects, keeps the front, and writes every generation down.

Its decisions depend on seeds and fits alone. Where and in which order fits are computed changes nothing: they are
collected per generation before anything is decided.
"""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from fitters.expressions import parse
from fitters.fits import Confirmed, DescriptionJob, confirm, describe, screen
from gpsearch.evolution.island import Island, Offspring, advance, migrate, survive
from gpsearch.front import Front, Member, Store
from gpsearch.genomes import Genome
from gpsearch.search.plan import Plan
from workers import Executor

P = TypeVar("P")
R = TypeVar("R")

TASK_SECONDS = 0.5
"""Candidates are batched into tasks of about so long: a scheduler handles a few hundred tasks a second."""


@dataclass(frozen=True)
class Standing:
    """Where a run stands, for whoever watches it. `seconds` is the time it has run, sessions added up."""

    generation: int
    candidates: int
    fitted: int
    seconds: float
    best: float
    front: Front


class Watcher(Protocol):
    """Whoever is told how the search goes on."""

    def stage(self, name: str, total: int) -> None:
        """A stage of `total` steps begins: "baselines", "generation 7", "confirming", "describing"."""

    def step(self, count: int) -> None:
        """So many steps of the stage are done."""

    def generation(self, standing: Standing) -> None:
        """A generation is whole and stored."""


class Search:
    """One run on its way. `run` returns when a budget is used up; what is stored is always a whole generation."""

    def __init__(self, plan: Plan, store: Store, executor: Executor, watcher: Watcher) -> None:
        self.plan, self.store, self.executor, self.watcher = plan, store, executor, watcher
        self.islands = store.islands() or tuple(Island(number) for number in range(plan.islands))
        self.front = store.front()
        self.errors = store.errors()
        self.seen = store.seen()
        _, self.candidates, self.fitted = store.totals()
        self.seconds_before = store.seconds
        self.started = time.monotonic()
        self.seconds_per_candidate = 0.1

    @property
    def seconds(self) -> float:
        return self.seconds_before + time.monotonic() - self.started

    @property
    def generation(self) -> int:
        return self.islands[0].generation

    def run(self) -> str:
        """Breeds until a budget is used up, describes the front; returns which budget it was."""
        self.fit_baselines()
        while (reason := self._exhausted()) is None:
            try:
                whole = self._one_generation()
            finally:
                self._keep_fits()
            if not whole:
                reason = "minutes"
                break
        self.describe_front()
        return reason

    def fit_baselines(self) -> None:
        """Fits and stores the published formulas that have not been fitted yet."""
        there = self.store.baselines()
        names = [name for name in self.plan.baselines if name not in there]
        if not names:
            return
        jobs = [self.plan.baseline_job(name) for name in names]
        self.watcher.stage("baselines", 2 * len(names))
        confirmed = {names[i]: found[0] for i, found in self._run(confirm, jobs, "baseline")}
        tasks = [DescriptionJob(job, confirmed[name].fit) for name, job in zip(names, jobs, strict=True)]
        for i, description in self._run(describe, tasks, "describe-baseline"):
            with self.store.transaction():
                self.store.save_baseline(names[i], description, confirmed[names[i]].seconds)

    def describe_front(self) -> None:
        """Polishes and describes, on all cells in float64, the front members that have not been yet."""
        there = self.store.descriptions()
        members = [member for member in self.front.members if member.expression not in there]
        if not members:
            return
        self.watcher.stage("describing the front", len(members))
        jobs = [DescriptionJob(self.plan.job(member.expression), member.fit) for member in members]
        for i, description in self._run(describe, jobs, "describe"):
            with self.store.transaction():
                self.store.save_description(members[i].expression, description)

    def _exhausted(self) -> str | None:
        budget = self.plan.budget
        if budget.generations is not None and self.generation >= budget.generations:
            return "generations"
        if budget.candidates is not None and self.candidates >= budget.candidates:
            return "candidates"
        return "minutes" if self._late() else None

    def _late(self) -> bool:
        return self.plan.budget.seconds is not None and self.seconds >= self.plan.budget.seconds

    def _one_generation(self) -> bool:
        """Breeds, fits, selects and stores one generation; False where time ran out before it was whole."""
        began = self.seconds
        broods = [advance(island, self.plan.breeding, self.plan.seed) for island in self.islands]
        first = {start: _Origin(Genome(start), 0, 0) for start in self._starts()}
        for island, brood in zip(self.islands, broods, strict=True):
            for child in brood:
                first.setdefault(child.expression, _Origin(child.genome, island.number, island.generation + 1))
        if not self._screen([text for text in first if text not in self.errors]):
            return False
        new = {text: origin for text, origin in first.items() if text not in self.seen}
        self.front = self.front.updated(self._confirm(new, _sizes(broods) | self._starts()))
        self.islands = self._selected(broods)
        self._save(new, sum(map(len, broods)), self.seconds - began)
        return True

    def _starts(self) -> dict[str, int]:
        """Size by expression of the starts, which the first generation judges as they are."""
        if self.generation > 0:
            return {}
        return {start: parse(start).nodes for start in self.plan.breeding.starts}

    def _screen(self, texts: Sequence[str]) -> bool:
        """Fits what is new on the small sample; False where time ran out on the way."""
        size = max(1, min(int(TASK_SECONDS / self.seconds_per_candidate), len(texts) // self.executor.processes))
        batches = [texts[i : i + size] for i in range(0, len(texts), size)]
        self.watcher.stage(f"generation {self.generation + 1}", len(texts))
        began, done = time.monotonic(), 0
        fits = self._run(
            screen, [self.plan.job(*batch) for batch in batches], f"fit-generation{self.generation + 1}"
        )
        found: dict[str, float] = {}
        try:
            for i, results in fits:
                found.update((text, fit.error) for text, fit in zip(batches[i], results, strict=True))
                done += len(results)
                if self._late() and done < len(texts):
                    return False
        finally:
            self.errors.update(found)
        if done:
            self.seconds_per_candidate = (time.monotonic() - began) * self.executor.processes / done
        return True

    def _keep_fits(self) -> None:
        """Stores what was fitted in a generation that was broken off, so that it need not be fitted again."""
        found = {text: error for text, error in self.errors.items() if text not in self.seen}
        if found:
            with self.store.transaction():
                self.store.save_errors(found, None)
                self.store.save_seconds(self.seconds)

    def _confirm(self, new: Mapping[str, "_Origin"], sizes: Mapping[str, int]) -> list[Member]:
        """The candidates that could enter the front, fitted on all cells."""
        texts = self.front.worth_confirming({text: (sizes[text], self.errors[text]) for text in new})
        self.watcher.stage("confirming", len(texts))
        members = []
        jobs = [self.plan.job(text) for text in texts]
        for i, results in self._run(confirm, jobs, f"confirm-generation{self.generation + 1}"):
            confirmed: Confirmed = results[0]
            origin, text = new[texts[i]], texts[i]
            members.append(
                Member(
                    expression=text,
                    nodes=sizes[text],
                    genome=origin.genome,
                    island=origin.island,
                    generation=origin.generation,
                    fit=confirmed.fit,
                    screened=confirmed.screened,
                )
            )
        return members

    def _selected(self, broods: Sequence[Sequence[Offspring]]) -> tuple[Island, ...]:
        islands = tuple(
            survive(island, brood, self.errors) for island, brood in zip(self.islands, broods, strict=True)
        )
        if islands[0].generation % self.plan.migrate_every == 0:
            return migrate(islands, self.plan.migrants)
        return islands

    def _save(self, new: Mapping[str, "_Origin"], candidates: int, seconds: float) -> None:
        self.candidates += candidates
        self.fitted += len(new)
        self.seen.update(new)
        best = min(individual.error for island in self.islands for individual in island.population)
        with self.store.transaction():
            self.store.require_generation(self.generation - 1)
            self.store.save_errors({text: self.errors[text] for text in new}, self.generation)
            self.store.save_islands(self.islands)
            self.store.save_front(self.front)
            self.store.save_seconds(self.seconds)
            self.store.save_generation(self.generation, candidates, len(new), best, seconds)
        self.watcher.generation(
            Standing(self.generation, self.candidates, self.fitted, self.seconds, best, self.front)
        )

    def _run(self, function: Callable[[Any, P], R], payloads: Sequence[P], label: str) -> Iterator[tuple[int, R]]:
        """Runs tasks and tells the watcher of every result."""
        for i, result in self.executor.run(function, self.plan.recipe, payloads, label=label):
            self.watcher.step(len(result) if isinstance(result, list) else 1)
            yield i, result


@dataclass(frozen=True)
class _Origin:
    """The genome that first stood for an expression, and where."""

    genome: Genome
    island: int
    generation: int


def _sizes(broods: Sequence[Sequence[Offspring]]) -> dict[str, int]:
    return {child.expression: child.nodes for brood in broods for child in brood}
