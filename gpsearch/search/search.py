"""The search: breeds, has fits computed, selects, keeps the front, and writes every generation down.

Its decisions depend on seeds and fits alone. Where and in which order fits are computed changes nothing: they are
collected per generation before anything is decided.
"""

import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import astuple, dataclass
from itertools import islice
from typing import Any, Protocol, TypeVar

from fitters.baselines import TABULATED, BaselineJob, Judged, judge_baseline
from fitters.expressions import parse
from fitters.expressions.canonical import Canonical, canonical
from fitters.fits import Candidate, ConfirmJob, DescriptionJob, ScreenJob, confirm, describe, screen
from fitters.fits.problem import CHANNELS
from gpsearch.evolution.island import Island, Offspring, advance, migrate, survive
from gpsearch.front import (
    FormulaBaseline,
    Front,
    Generation,
    Member,
    Screened,
    Store,
    TabulatedBaseline,
)
from gpsearch.search.entrants import Entrant, entrants
from gpsearch.search.memory import Known, Memory, Parameters
from gpsearch.search.plan import Plan
from workers import Executor

P = TypeVar("P")
R = TypeVar("R")

TASK_SECONDS = 0.5
"""Candidates are batched into tasks of about so long: a scheduler handles a few hundred tasks a second."""

PARENTS = 1 / 3
"""The share of a population that matters: of a tournament of eight, the winner is in it 96 times of 100."""


@dataclass(frozen=True)
class Standing:
    """Where a run stands, for whoever watches it. `seconds` is the time it has searched, sessions added up."""

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
        self.memory = Memory({key: Known(*found) for key, found in store.fits().items()}, store.seen())
        self._prepare_parents()
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
        # The minutes are the search's own: its baselines may take longer than a short budget.
        self.started = time.monotonic()
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
        """Fits and stores the baselines that have not been fitted yet."""
        there = self.store.baselines()
        names = [name for name in self.plan.baselines if name not in there]
        if not names:
            return
        tabulated = [name for name in names if name in TABULATED]
        formulas = [name for name in names if name not in TABULATED]
        self.watcher.stage("baselines", 2 * len(formulas) + self.plan.materials * len(tabulated))
        self._fit_formulas(formulas)
        self._fit_tabulated(tabulated)

    def _fit_formulas(self, names: Sequence[str]) -> None:
        jobs = [self.plan.formula_job(name) for name in names]
        confirmed = {names[i]: found for i, found in self._run(confirm, map(ConfirmJob, jobs), "baseline")}
        tasks = [DescriptionJob(job, confirmed[name].fit) for name, job in zip(names, jobs, strict=True)]
        for i, description in self._run(describe, tasks, "describe-baseline"):
            with self.store.transaction():
                self.store.save_baseline(names[i], FormulaBaseline(description, confirmed[names[i]].seconds))

    def _fit_tabulated(self, names: Sequence[str]) -> None:
        """Every name and material is a task of its own; a name is stored once its last material is judged."""
        jobs = [BaselineJob(name, material) for name in names for material in range(self.plan.materials)]
        found: dict[str, dict[int, Judged]] = {name: {} for name in names}
        for i, judged in self._run(judge_baseline, jobs, "judge-baseline"):
            by_material = found[jobs[i].name]
            by_material[jobs[i].material] = judged
            if len(by_material) == self.plan.materials:
                in_order = [by_material[material] for material in range(self.plan.materials)]
                with self.store.transaction():
                    self.store.save_baseline(jobs[i].name, TabulatedBaseline.of(jobs[i].name, in_order))

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
        clock = _Stages(self.seconds)
        broods: list[tuple[Offspring, ...]] = []
        self.watcher.stage(f"generation {self.generation + 1}", self.plan.breeding.size * len(self.islands))
        if not self._screen(self._bred(broods, clock)):
            return False
        found = entrants(self.islands, broods, self._starts())
        # The smallest expression of a canonical form may not be the first, and face a higher bar.
        if not self._screen(e for key, e in found.items() if not self.memory.knows(key, self._bar(e.nodes))):
            return False
        clock.ends("screening", self.seconds)
        fitted = [self.memory.known[key] for key in found if key not in self.memory.seen]
        new = {key: e for key, e in found.items() if self.memory.is_new(key, e.nodes)}
        confirmed = self._confirm(new.values())
        self.front = self.front.updated(confirmed)
        clock.ends("confirming", self.seconds)
        self.islands = self._selected(broods)
        with self.store.transaction():
            self.store.require_generation(self.generation - 1)
            self._save_fits()
            self.memory.seen |= {key: entrant.nodes for key, entrant in new.items()}
            self.store.save_seen({key: entrant.nodes for key, entrant in new.items()}, self.generation)
            self.store.save_islands(self.islands)
            self.store.save_front(self.front)
            self._prepare_parents({c.expression: c.canonical for brood in broods for c in brood})
            clock.ends("storing", self.seconds)
            self.store.save_seconds(self.seconds)
            best = min(individual.error for island in self.islands for individual in island.population)
            bred = sum(map(len, broods))
            given_up = sum(math.isfinite(known.bar) for known in fitted)
            seconds, stages = self.seconds - clock.began, clock.seconds
            self.store.save_generation(
                Generation(self.generation, bred, len(fitted), given_up, len(confirmed), best, seconds, stages)
            )
        self.candidates += bred
        self.fitted += len(fitted)
        self.watcher.generation(
            Standing(self.generation, self.candidates, self.fitted, self.seconds, best, self.front)
        )
        return True

    def _bar(self, nodes: int) -> float:
        """The error that a candidate of this size must come near, or its fit is given up.

        What the better third of an island reaches, where that is worst, or what would enter the front, if that is
        more. Infinite while there is no population, or for a run without the rule.
        """
        if not self.plan.early_stopping or self.generation == 0:
            return math.inf
        return max(self.better_third, self.front.bar(nodes))

    def _starts(self) -> tuple[str, ...]:
        """The first generation judges the starts as they are, too."""
        return self.plan.breeding.starts if self.generation == 0 else ()

    def _bred(self, broods: list[tuple[Offspring, ...]], clock: "_Stages") -> Iterator[Entrant]:
        """Breeds island by island into `broods`; yields what must be fitted, while workers fit the first of it."""
        asked: set[str] = set()
        for entrant in map(Entrant.of_start, self._starts()):
            asked.add(entrant.canonical.text)
            if not self.memory.knows(entrant.canonical.text, math.inf):
                yield entrant
        for island in self.islands:
            with clock.within("breeding"):
                broods.append(advance(island, self.plan.breeding, self.plan.seed))
            for entrant in (Entrant.of(child, island) for child in broods[-1]):
                key = entrant.canonical.text
                if key in asked or self.memory.knows(key, self._bar(entrant.nodes)):
                    self.watcher.step(1)
                else:
                    asked.add(key)
                    yield entrant

    def _screen(self, unknown: Iterable[Entrant]) -> bool:
        """Fits what is new on the small sample; False where time ran out on the way."""
        share = self.plan.breeding.size * len(self.islands) // self.executor.processes
        size = max(1, min(int(TASK_SECONDS / self.seconds_per_candidate), share))
        batches = _Batches(unknown, size)
        jobs: list[ScreenJob] = []

        def ask() -> Iterator[ScreenJob]:
            for batch in batches:
                jobs.append(self.plan.screening(*map(self._candidate, batch)))
                yield jobs[-1]

        began, done = time.monotonic(), 0
        for i, fits in self._run(screen, ask(), f"fit-generation{self.generation + 1}"):
            for candidate, fit in zip(jobs[i].candidates, fits, strict=True):
                self.memory.learn(candidate.expression, fit, candidate.bar)
            done += 1
            if self._late() and not (batches.exhausted and done == len(jobs)):
                return False
        if done:
            fitted = sum(len(job.candidates) for job in jobs)
            self.seconds_per_candidate = (time.monotonic() - began) * self.executor.processes / fitted
        return True

    def _candidate(self, entrant: Entrant) -> Candidate:
        near = self.memory.warm_start(entrant.canonical, entrant.parent) if self.plan.warm_starts else None
        return Candidate(entrant.canonical.text, self._bar(entrant.nodes), near)

    def _keep_fits(self) -> None:
        """Stores what was fitted in a generation that was broken off, so that it need not be fitted again.

        But for what was fitted once more under a higher bar: the parents must stay what they were.
        """
        self.memory.fresh -= self.memory.seen.keys()
        if self.memory.fresh:
            with self.store.transaction():
                self._save_fits()
                self.store.save_seconds(self.seconds)

    def _save_fits(self) -> None:
        keys = sorted(self.memory.fresh)
        known, learned = self.memory.known, self.memory.learned
        self.store.save_fits((key, *astuple(known[key]), learned[key]) for key in keys)
        self.memory.fresh.clear()

    def _confirm(self, new: Iterable[Entrant]) -> list[Member]:
        """The candidates that could enter the front, fitted on all cells."""
        by_text = {entrant.expression: entrant for entrant in new}
        known = {text: self.memory.known[entrant.canonical.text] for text, entrant in by_text.items()}
        texts = self.front.worth_confirming(
            Screened(text, by_text[text].nodes, fit.error, fit.standard_error)
            for text, fit in known.items()
            if fit.bar == math.inf
        )
        self.watcher.stage("confirming", len(texts))
        at_hand = self.memory.parameters.keys() | self.memory.learned.keys()
        missing = {by_text[text].canonical.text for text in texts} - at_hand
        self.memory.learned |= self._stored_parameters(sorted(missing))
        tasks = [
            ConfirmJob(
                self.plan.job(text),
                self.memory.columns(by_text[text].canonical),
                self.front.error(by_text[text].nodes),
            )
            for text in texts
        ]
        confirmed = self._run(confirm, tasks, f"confirm-generation{self.generation + 1}")
        return [by_text[texts[i]].member(found, known[texts[i]].error) for i, found in confirmed]

    def _selected(self, broods: Sequence[Sequence[Offspring]]) -> tuple[Island, ...]:
        errors = {c.expression: self.memory.known[c.canonical.text].error for brood in broods for c in brood}
        islands = tuple(survive(island, brood, errors) for island, brood in zip(self.islands, broods, strict=True))
        if islands[0].generation % self.plan.migrate_every == 0:
            return migrate(islands, self.plan.migrants)
        return islands

    def _prepare_parents(self, forms: Mapping[str, Canonical] | None = None) -> None:
        """What the islands' next children need of their parents. `forms` are those that are at hand."""
        population = {individual.expression for island in self.islands for individual in island.population}
        known = forms or {expression: canonical(parse(expression)) for expression in sorted(population)}
        forms = {expression: known[expression] for expression in sorted(population)}
        self.memory.parents(forms, self._stored_parameters)
        populated = (island for island in self.islands if island.population)
        self.better_third = max((island.quantile(PARENTS) for island in populated), default=math.inf)

    def _stored_parameters(self, keys: Sequence[str]) -> dict[str, Parameters]:
        return self.store.parameters(keys, len(CHANNELS) * self.plan.materials)

    def _run(self, function: Callable[[Any, P], R], payloads: Iterable[P], label: str) -> Iterator[tuple[int, R]]:
        """Runs tasks and tells the watcher of every result."""
        for i, result in self.executor.run(function, self.plan.recipe, payloads, label=label):
            self.watcher.step(len(result) if isinstance(result, list) else 1)
            yield i, result


class _Stages:
    """Seconds of the stages of a generation."""

    def __init__(self, now: float) -> None:
        self.began = self._last = now
        self.seconds: dict[str, float] = {}

    @contextmanager
    def within(self, stage: str) -> Iterator[None]:
        """What is spent inside counts for a stage of its own."""
        began = time.monotonic()
        yield
        spent = time.monotonic() - began
        self.seconds[stage] = self.seconds.get(stage, 0.0) + spent
        self._last += spent

    def ends(self, stage: str, now: float) -> None:
        self.seconds[stage] = now - self._last
        self._last = now


class _Batches:
    """Entrants in lists of a size; `exhausted` as soon as the last is handed out."""

    def __init__(self, entrants: Iterable[Entrant], size: int) -> None:
        self._entrants, self._size = iter(entrants), size
        self.exhausted = False

    def __iter__(self) -> Iterator[list[Entrant]]:
        batch = list(islice(self._entrants, self._size))
        while batch:
            following = list(islice(self._entrants, self._size))
            self.exhausted = not following
            yield batch
            batch = following
