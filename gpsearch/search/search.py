"""The search: islands in parallel, from migration to migration, until a budget is used up.

Its decisions depend on seeds and fits only: the same configuration gives the same front on one process or many,
with or without lost workers, and however often it is stopped and resumed.
"""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol

from gpsearch.evolution.island import Island, migrate
from gpsearch.run import Front, Generation, Member, WritableStore
from gpsearch.search.island_search import IslandSearch
from gpsearch.search.memory import StoredKnowledge
from gpsearch.search.plan import Plan
from gpsearch.search.references import baseline_lanes, description_lanes, unfinished
from gpsearch.search.transfers import transfer_lanes
from workers import Done, Executor, Incident, Lane, run_lanes


@dataclass(frozen=True)
class SearchStatus:
    """How far a search is.

    generation: the last one that all islands have finished
    candidates, fitted: numbers so far
    seconds:    of search so far, the sum of all sessions
    """

    generation: int
    candidates: int
    fitted: int
    seconds: float
    front: Front


class Watcher(Protocol):
    """Is informed of the progress of a search."""

    def stage(self, name: str, total: int | None) -> None:
        """A stage of `total` steps begins: "baselines", "searching", "describing the front", "test materials"."""

    def step(self, count: int) -> None:
        """`count` more steps of the stage are done."""

    def generation(self, status: SearchStatus) -> None:
        """All islands have finished another generation, and it is stored."""

    def incident(self, incident: Incident) -> None:
        """Something happened to the cluster."""


class Search:
    """The search of one run. `run` returns when a budget is used up. Only whole generations are stored."""

    def __init__(self, plan: Plan, store: WritableStore, executor: Executor, watcher: Watcher) -> None:
        self.plan, self.store, self.executor, self.watcher = plan, store, executor, watcher
        islands = store.islands() or self._new_islands()
        stored = StoredKnowledge(store, store.migrations * plan.migrate_every)
        self.shared = stored.shared()
        self.searches = [self._island_search(island) for island in islands]
        for search in self.searches:
            stored.restore(search.memory, search.island)
        self.front = store.front()
        self.reported_generation, self.candidates, self.fitted = store.totals()
        self.seconds_before = store.seconds
        self.started = time.monotonic()

    def _new_islands(self) -> tuple[Island, ...]:
        """New islands. All are stored now, because a run may stop when only some of them have a generation."""
        islands = tuple(map(Island, range(self.plan.islands)))
        with self.store.transaction():
            self.store.save_islands(islands)
        return islands

    def seconds(self) -> float:
        """How long the run has searched, in all sessions."""
        return self.seconds_before + time.monotonic() - self.started

    @property
    def generation(self) -> int:
        """The last one that all islands have finished."""
        return min(search.island.generation for search in self.searches)

    def run(self) -> str:
        """Searches until a budget is used up, describes and tests the front. Returns the name of that budget."""
        self.fit_baselines()
        # The budget of minutes is without the baselines, which may take longer than a short budget.
        self.started = time.monotonic()
        reason = self._search()
        self.describe_front()
        self.fit_test_materials()
        return reason

    def fit_baselines(self) -> None:
        """Fits and stores the baselines that have not been fitted yet."""
        total, lanes = baseline_lanes(self.plan, self.store)
        if lanes:
            self.watcher.stage("baselines", total)
            self._run(lanes, stop=lambda: False)

    def describe_front(self) -> None:
        """Polishes, describes and culls, on all cells in float64, the front members that have not been yet."""
        steps, lanes = description_lanes(self.plan, self.store, unfinished(self.store, self.front.members))
        if lanes:
            self.watcher.stage("describing the front", steps)
            self._run(lanes, stop=lambda: False)

    def fit_test_materials(self) -> None:
        """Fits the described formulas and the baselines to the test materials."""
        total, lanes = transfer_lanes(self.plan, self.store)
        if lanes:
            self.watcher.stage("test materials", total)
            self._run(lanes, stop=lambda: False)

    def _search(self) -> str:
        """Each pass of the loop goes from one migration to the next."""
        last, every = self.plan.last_generation, self.plan.migrate_every
        per_generation = self.plan.breeding.size * self.plan.islands
        self.watcher.stage("searching", None if last is None else last * per_generation)
        self.watcher.step(self.candidates)
        while last is None or self.generation < last:
            due = (self.store.migrations + 1) * every
            target = due if last is None else min(due, last)
            if not self._run((search.advance_to(target) for search in self.searches), stop=self._out_of_time):
                return "minutes"
            if self.generation == due:
                self._migrate()
        return "generations" if last == self.plan.budget.generations else "candidates"

    def _migrate(self) -> None:
        """The best individuals migrate, and all islands get to know the results of each."""
        self.shared.join(search.memory for search in self.searches)
        islands = migrate([search.island for search in self.searches], self.plan.migrants)
        with self.store.transaction():
            self.store.save_islands(islands)
            self.store.keep_confirmed(self.shared.front)
            self.store.save_migrations(self.store.migrations + 1)
        self.searches = [self._island_search(island) for island in islands]

    def _island_search(self, island: Island) -> IslandSearch:
        return IslandSearch(
            self.plan,
            self.store,
            island,
            self.shared,
            on_generation=self._on_generation,
            seconds=self.seconds,
        )

    def _run(self, lanes: Iterable[Lane], stop: Callable[[], bool]) -> bool:
        def stop_and_note() -> bool:
            self._note_incidents()
            return stop()

        try:
            return run_lanes(self.executor, lanes, done=self._done, stop=stop_and_note)
        finally:
            self._note_incidents()

    def _out_of_time(self) -> bool:
        return self.plan.budget.seconds is not None and self.seconds() >= self.plan.budget.seconds

    # reports

    def _done(self, done: Done) -> None:
        if done.job.kind != "confirm":
            self.watcher.step(1)

    def _on_generation(self, row: Generation, screened: int, confirmed: list[Member]) -> None:
        """Counts and reports a generation of an island, which is stored."""
        before = self.reported_generation
        self.candidates += row.candidates
        self.fitted += row.fitted
        self.front = self.front.updated(confirmed)
        self.watcher.step(row.candidates - screened)
        if self.generation > before:
            self.reported_generation = self.generation
            self.watcher.generation(
                SearchStatus(self.generation, self.candidates, self.fitted, self.seconds(), self.front)
            )

    def _note_incidents(self) -> None:
        """Writes what happened to the cluster to the event log, and reports it."""
        incidents = self.executor.incidents()
        if incidents:
            with self.store.transaction():
                for incident in incidents:
                    self.store.log(incident.kind, incident.detail)
            for incident in incidents:
                self.watcher.incident(incident)
