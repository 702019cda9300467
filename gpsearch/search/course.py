"""The course of one island from migration to migration: it breeds, has fits computed, selects, and writes it down.

It waits for its own fits alone, never for another island's. What it decides depends on seeds, its own fits, and
what all islands knew at the last migration; where, when and in which order fits are computed changes nothing.
"""

import math
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from fitters.expressions.canonical import Canonical
from fitters.fitting import Candidate, Confirmed, ConfirmJob, confirm
from fitters.fitting.problem import CHANNELS
from gpsearch.evolution.island import Island, advance, survive
from gpsearch.run import Generation, Known, Member, Quarantined, Screened, WritableStore
from gpsearch.search.entrants import Entrant, entrants
from gpsearch.search.memory import Memory, Parameters, Shared, named
from gpsearch.search.plan import Plan
from workers import Failure, Job, Lane, Stopped, WorkersError

PARENTS = 1 / 3
"""The share of a population that matters: of a tournament of eight, the winner is in it 96 times of 100."""

FAILURES = 8
FAILING_SHARE = 0.1
"""Where more candidates of a generation than both cannot be computed, or all of several, none is to blame."""

SCREEN_SECONDS = 0.02
"""What screening a candidate takes, more or less; the executor measures it."""


class Course:
    """One island on its way.

    told:    is called with what a generation has brought, how many were screened for it, and what was confirmed,
             once it is stored
    seconds: tells for how long the run has searched
    """

    def __init__(
        self,
        plan: Plan,
        store: WritableStore,
        island: Island,
        shared: Shared,
        *,
        told: Callable[[Generation, int, list[Member]], None],
        seconds: Callable[[], float],
    ) -> None:
        self.plan, self.store, self.island = plan, store, island
        self.memory = Memory(island.number, shared)
        self.told, self.seconds = told, seconds
        self._failed: list[Quarantined] = []

    @property
    def under_way(self) -> int:
        """The number of the generation that is next."""
        return self.island.generation + 1

    def until(self, generation: int) -> Lane:
        """Generations up to a given one."""
        self._prepare_parents({})
        while self.island.generation < generation:
            yield from self._one_generation()

    def _one_generation(self) -> Lane:
        clock = _Stages()
        with clock.stage("breeding"):
            brood = advance(self.island, self.plan.breeding, self.plan.seed)
            # The first generation judges the starts as they are, too.
            starts = self.plan.breeding.starts if (self.under_way, self.island.number) == (1, 0) else ()
            found = entrants(self.island, brood, starts)
        with clock.stage("screening"):
            unknown = [e for key, e in found.items() if not self.memory.knows(key, self._bar(e.nodes))]
            yield from self._screened(unknown)
        new = {key: entrant for key, entrant in found.items() if entrant.nodes < self.memory.seen(key)}
        bred = {child.canonical.text for child in brood}
        fitted = [self.memory[key] for key in found if key in bred and math.isinf(self.memory.seen(key))]
        with clock.stage("confirming"):
            confirmed = yield from self._confirmed(new.values())
        errors = {c.expression: self.memory[c.canonical.text].error for c in brood}
        after = survive(self.island, brood, errors)
        sizes = {key: entrant.nodes for key, entrant in new.items()}
        forms = {child.expression: child.canonical for child in brood}
        front = self.memory.front.updated(confirmed)
        seconds = self.seconds()
        with self.store.transaction():
            with clock.stage("storing"):
                self._save_fits()
                self.store.save_seen(sizes, self.island.number, self.under_way)
                self.store.save_confirmed(confirmed, self.island.number, self.under_way)
                self.store.save_islands([after])
                self.store.save_seconds(seconds)
            row = Generation(
                island=self.island.number,
                generation=after.generation,
                candidates=len(brood),
                fitted=len(fitted),
                given_up=sum(math.isfinite(known.bar) for known in fitted),
                confirmed=len(confirmed),
                best=min(individual.error for individual in after.population),
                seconds=clock.total,
                stages=clock.seconds,
                at=seconds,
                arrived=tuple((m.nodes, m.error) for m in front.members if m in confirmed),
            )
            self.store.save_generation(row)
        self.island = after
        self.memory.end_generation(confirmed, sizes)
        self._prepare_parents(forms)
        self.told(row, len(unknown), confirmed)

    # screening

    def _screened(self, unknown: list[Entrant]) -> Lane:
        """Fits candidates on the small sample."""
        job = self._job("screen", self.plan.screen, list(map(self._candidate, unknown)), SCREEN_SECONDS)
        try:
            results = yield job
        except Stopped as stopped:
            # What failed may have done so for the same reason as what stops us: it is tried again.
            fits = {i: result for i, result in stopped.results.items() if not isinstance(result, Failure)}
            self._learn(unknown, fits)
            self._keep_fits()
            raise
        _require_mostly_computed(job, results)
        self._learn(unknown, dict(enumerate(results)))

    def _learn(self, asked: list[Entrant], results: Mapping[int, Any]) -> None:
        for index, result in results.items():
            entrant = asked[index]
            if isinstance(result, Failure):
                targets = len(CHANNELS) * self.plan.materials
                self.memory.learn_failure(entrant.canonical, targets, self.under_way)
                self._quarantine(entrant, "screen", result)
            else:
                bar = self._bar(entrant.nodes)
                self.memory.learn(entrant.canonical.text, result, bar, self.under_way)

    def _candidate(self, entrant: Entrant) -> Candidate:
        near = self.memory.warm_start(entrant.canonical, entrant.parent) if self.plan.warm_starts else None
        return Candidate(entrant.canonical.text, self._bar(entrant.nodes), near)

    def _bar(self, nodes: int) -> float:
        """The error that a candidate of this size must come near, or its fit is given up.

        What the better third of the island reaches, or what would enter the front, if that is more. Infinite while
        there is no population, or for a run without the rule.
        """
        if not self.plan.early_stopping or not self.island.population:
            return math.inf
        return max(self.island.quantile(PARENTS), self.memory.front.bar(nodes))

    def _keep_fits(self) -> None:
        """Stores what was fitted in a generation that is broken off, so that it need not be fitted again."""
        with self.store.transaction():
            self._save_fits()
            self.store.save_seconds(self.seconds())

    def _save_fits(self) -> None:
        learned = self.memory.learned
        self.store.save_fits((key, self.memory.fresh[key], learned[key]) for key in sorted(learned))
        self.store.save_quarantined(self._failed)
        self._failed = []

    def _quarantine(self, entrant: Entrant, stage: str, failure: Failure) -> None:
        self._failed.append(
            Quarantined(entrant.expression, stage, failure.reason, self.island.number, self.under_way)
        )

    # confirming

    def _confirmed(self, new: Iterable[Entrant]) -> Generator[Job, list[Any], list[Member]]:
        """The candidates that could enter the front, fitted on all cells."""
        by_text = {entrant.expression: entrant for entrant in new}
        known = {text: self.memory[entrant.canonical.text] for text, entrant in by_text.items()}
        texts = self.memory.front.worth_confirming(
            Screened(text, by_text[text].nodes, fit.error, fit.standard_error)
            for text, fit in known.items()
            if fit.bar == math.inf
        )
        forms = {text: by_text[text].canonical for text in texts}
        values = self.memory.parameters({form.text for form in forms.values()}, self._load)
        tasks = [
            ConfirmJob(
                self.plan.job(text),
                named(values[forms[text].text], forms[text]),
                self.memory.front.error(by_text[text].nodes),
            )
            for text in texts
        ]
        job = self._job("confirm", confirm, tasks, 1.0)
        try:
            results: list[Confirmed | Failure] = yield job
        except Stopped:
            self._keep_fits()
            raise
        _require_mostly_computed(job, results)
        confirmed = []
        for text, result in zip(texts, results, strict=True):
            if isinstance(result, Failure):
                self._quarantine(by_text[text], "confirm", result)
            else:
                confirmed.append(by_text[text].member(result, known[text].error))
        return confirmed

    # helpers

    def _job(self, kind: str, function: Callable[[Any, Any], Any], items: list[Any], seconds: float) -> Job:
        label = f"{kind} island {self.island.number} generation {self.under_way}"
        return Job(function, self.plan.recipe, items, label, seconds)

    def _prepare_parents(self, forms: Mapping[str, Canonical]) -> None:
        """What the next children need of their parents. `forms` are those that are at hand."""
        population = {individual.expression for individual in self.island.population}
        self.memory.parents(population, forms, self._load)

    def _load(self, fits: Mapping[str, Known]) -> dict[str, Parameters]:
        return self.store.parameters(fits, len(CHANNELS) * self.plan.materials)


def _require_mostly_computed(job: Job, results: list[Any]) -> None:
    """Raises `WorkersError` where so many items failed that they are not to blame themselves."""
    failed = [result for result in results if isinstance(result, Failure)]
    if len(failed) > max(FAILURES, FAILING_SHARE * len(results)) or len(failed) == len(results) > 1:
        raise WorkersError(
            f"{job.label}: {len(failed)} of {len(results)} candidates could not be computed; the last:"
            f" {failed[-1].reason}. That many are not to blame themselves: see the workers' logs"
        )


class _Stages:
    """Seconds of the stages of a generation."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        began = time.monotonic()
        yield
        self.seconds[name] = time.monotonic() - began

    @property
    def total(self) -> float:
        return sum(self.seconds.values())
