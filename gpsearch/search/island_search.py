"""The search of one island from migration to migration: it breeds, has fits computed, selects and stores.

It waits for its own fits only, not for other islands. Its decisions depend on seeds, its own fits, and what all
islands knew at the last migration, and not on where, when or in which order fits are computed.
"""

import math
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from fitters.expressions.canonical import Canonical
from fitters.fitting import Candidate, Confirmed, ConfirmJob, confirm
from fitters.grid import CHANNELS
from gpsearch.evolution.island import Island, Offspring, advance, survive
from gpsearch.run import Generation, Known, Member, Quarantined, Screened, WritableStore
from gpsearch.search.memory import Memory, Parameters, SharedKnowledge, named
from gpsearch.search.plan import Plan
from workers import Failure, Job, Lane, Stopped, WorkersError

PARENTS = 1 / 3
"""The share of a population that has nearly all children: of tournaments of eight, 96 % of the winners."""

FAILURES = 8
FAILING_SHARE = 0.1
"""If more candidates of a generation than both fail, or all of several, then the cause lies with the workers."""

SCREEN_SECONDS = 0.02
"""A first guess of the time that screening takes per candidate; the executor measures it."""


class IslandSearch:
    """The search of one island between two migrations.

    on_generation: is called after a generation is stored, with its record, the number of its screened candidates,
                   and its confirmed candidates
    seconds:       returns how long the run has searched
    """

    def __init__(
        self,
        plan: Plan,
        store: WritableStore,
        island: Island,
        shared: SharedKnowledge,
        *,
        on_generation: Callable[[Generation, int, list[Member]], None],
        seconds: Callable[[], float],
    ) -> None:
        self.plan, self.store, self.island = plan, store, island
        self.memory = Memory(island.number, shared)
        self.on_generation, self.seconds = on_generation, seconds
        self._failed: list[Quarantined] = []

    @property
    def next_generation(self) -> int:
        """The number of the generation that is computed next."""
        return self.island.generation + 1

    def advance_to(self, generation: int) -> Lane:
        """Computes and stores generations up to and including the given one."""
        self._prepare_parents({})
        while self.island.generation < generation:
            yield from self._one_generation()

    def _one_generation(self) -> Lane:
        clock = _Stages()
        with clock.stage("breeding"):
            offspring = advance(self.island, self.plan.breeding, self.plan.seed)
            # The first generation of the first island also fits the starting expressions themselves.
            starts = self.plan.breeding.starts if (self.next_generation, self.island.number) == (1, 0) else ()
            candidates = smallest_of_each_form([*map(Offspring.of_start, starts), *offspring])
        with clock.stage("screening"):
            unknown = [c for key, c in candidates.items() if not self.memory.knows(key, self._bar(c.nodes))]
            yield from self._screened(unknown)
        new = {key: c for key, c in candidates.items() if c.nodes < self.memory.smallest(key)}
        bred = {child.canonical.text for child in offspring}
        fitted = [self.memory[key] for key in candidates if key in bred and math.isinf(self.memory.smallest(key))]
        with clock.stage("confirming"):
            confirmed = yield from self._confirmed(new.values())
        errors = {c.expression: self.memory[c.canonical.text].error for c in offspring}
        after = survive(self.island, offspring, errors)
        sizes = {key: candidate.nodes for key, candidate in new.items()}
        forms = {child.expression: child.canonical for child in offspring}
        front = self.memory.front.updated(confirmed)
        seconds = self.seconds()
        with self.store.transaction():
            with clock.stage("storing"):
                self._save_fits()
                self.store.save_seen(sizes, self.island.number, self.next_generation)
                self.store.save_confirmed(confirmed, self.island.number, self.next_generation)
                self.store.save_islands([after])
                self.store.save_seconds(seconds)
            row = Generation(
                island=self.island.number,
                generation=after.generation,
                candidates=len(offspring),
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
        self.on_generation(row, len(unknown), confirmed)

    # screening

    def _screened(self, unknown: list[Offspring]) -> Lane:
        """Fits candidates on the small sample."""
        job = self._job("screen", self.plan.screen, list(map(self._screen_job, unknown)), SCREEN_SECONDS)
        try:
            results = yield job
        except Stopped as stopped:
            # These failures may have the same cause as the stop: the candidates are tried again after a resume.
            fits = {i: result for i, result in stopped.results.items() if not isinstance(result, Failure)}
            self._learn(unknown, fits)
            self._keep_fits()
            raise
        _require_mostly_computed(job, results)
        self._learn(unknown, dict(enumerate(results)))

    def _learn(self, asked: list[Offspring], results: Mapping[int, Any]) -> None:
        for index, result in results.items():
            candidate = asked[index]
            if isinstance(result, Failure):
                targets = len(CHANNELS) * self.plan.materials
                self.memory.learn_failure(candidate.canonical, targets, self.next_generation)
                self._quarantine(candidate, "screen", result)
            else:
                bar = self._bar(candidate.nodes)
                self.memory.learn(candidate.canonical.text, result, bar, self.next_generation)

    def _screen_job(self, candidate: Offspring) -> Candidate:
        near = self.memory.warm_start(candidate.canonical, candidate.parent) if self.plan.warm_starts else None
        return Candidate(candidate.canonical.text, self._bar(candidate.nodes), near)

    def _bar(self, nodes: int) -> float:
        """The error that the fit of a candidate of this size must come near, or else it is given up.

        The largest error of the better third of the island or, if that is larger, the error that would enter the
        front. Infinite without a population and without early stopping.
        """
        if not self.plan.early_stopping or not self.island.population:
            return math.inf
        return max(self.island.quantile(PARENTS), self.memory.front.bar(nodes))

    def _keep_fits(self) -> None:
        """Stores the fits of an unfinished generation, so that they are not repeated after a resume."""
        with self.store.transaction():
            self._save_fits()
            self.store.save_seconds(self.seconds())

    def _save_fits(self) -> None:
        parameters = self.memory.new_parameters
        self.store.save_fits((key, self.memory.new_fits[key], parameters[key]) for key in sorted(parameters))
        self.store.save_quarantined(self._failed)
        self._failed = []

    def _quarantine(self, candidate: Offspring, stage: str, failure: Failure) -> None:
        self._failed.append(
            Quarantined(candidate.expression, stage, failure.reason, self.island.number, self.next_generation)
        )

    # confirming

    def _confirmed(self, new: Iterable[Offspring]) -> Generator[Job, list[Any], list[Member]]:
        """The candidates that could enter the front, fitted on all cells."""
        by_text = {candidate.expression: candidate for candidate in new}
        known = {text: self.memory[candidate.canonical.text] for text, candidate in by_text.items()}
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
                confirmed.append(self._member(by_text[text], result, known[text].error))
        return confirmed

    def _member(self, candidate: Offspring, confirmed: Confirmed, screened: float) -> Member:
        """The origin of a starting expression is generation 0."""
        return Member(
            expression=candidate.expression,
            nodes=candidate.nodes,
            genome=candidate.genome,
            island=self.island.number,
            generation=self.next_generation if candidate.genome.edits else 0,
            fit=confirmed.fit,
            screened=screened,
        )

    # helpers

    def _job(self, kind: str, function: Callable[[Any, Any], Any], items: list[Any], seconds: float) -> Job:
        label = f"{kind} island {self.island.number} generation {self.next_generation}"
        return Job(function, self.plan.recipe, items, label, seconds)

    def _prepare_parents(self, forms: Mapping[str, Canonical]) -> None:
        """Prepares what the next children need of their parents. Some canonical `forms` are known already."""
        population = {individual.expression for individual in self.island.population}
        self.memory.parents(population, forms, self._load)

    def _load(self, fits: Mapping[str, Known]) -> dict[str, Parameters]:
        return self.store.parameters(fits, len(CHANNELS) * self.plan.materials)


def smallest_of_each_form(offspring: Iterable[Offspring]) -> dict[str, Offspring]:
    """By canonical form the smallest expression of that form, the first of equally small ones."""
    smallest: dict[str, Offspring] = {}
    for candidate in offspring:
        before = smallest.get(candidate.canonical.text)
        if before is None or candidate.nodes < before.nodes:
            smallest[candidate.canonical.text] = candidate
    return smallest


def _require_mostly_computed(job: Job, results: list[Any]) -> None:
    """Raises `WorkersError` where too many items failed for the items to be the cause."""
    failed = [result for result in results if isinstance(result, Failure)]
    if len(failed) > max(FAILURES, FAILING_SHARE * len(results)) or len(failed) == len(results) > 1:
        raise WorkersError(
            f"{job.label}: {len(failed)} of {len(results)} candidates could not be computed; the last:"
            f" {failed[-1].reason}. The candidates are not the cause: see the workers' logs"
        )


class _Stages:
    """The seconds that each stage of a generation takes."""

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
