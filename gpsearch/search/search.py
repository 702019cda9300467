"""The search: islands side by side, from migration to migration, until a budget is used up.

Its decisions depend on seeds and fits alone: the same configuration gives the same front on one process or many,
whatever dies on the way, and however often it is stopped and goes on.
"""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol

from gpsearch.evolution.island import Island, migrate
from gpsearch.run import Front, Generation, Member, WritableStore
from gpsearch.search.course import Course
from gpsearch.search.plan import Plan
from gpsearch.search.recollection import Recollection
from gpsearch.search.references import baseline_lanes, description_lanes, unfinished
from gpsearch.search.transfers import transfer_lanes
from workers import Done, Executor, Incident, Lane, run_lanes


@dataclass(frozen=True)
class Standing:
    """Where a run stands, for whoever watches it. `seconds` is the time it has searched, sessions added up.

    generation: that all islands have reached
    """

    generation: int
    candidates: int
    fitted: int
    seconds: float
    front: Front


class Watcher(Protocol):
    """Whoever is told how the search goes on."""

    def stage(self, name: str, total: int | None) -> None:
        """A stage of `total` steps begins: "baselines", "searching", "describing the front", "test materials"."""

    def step(self, count: int) -> None:
        """So many steps of the stage are done."""

    def generation(self, standing: Standing) -> None:
        """Another generation of all islands is whole and stored."""

    def incident(self, incident: Incident) -> None:
        """Something happened to the cluster."""


class Search:
    """One run on its way. `run` returns when a budget is used up; what is stored are always whole generations."""

    def __init__(self, plan: Plan, store: WritableStore, executor: Executor, watcher: Watcher) -> None:
        self.plan, self.store, self.executor, self.watcher = plan, store, executor, watcher
        islands = store.islands() or self._settled()
        recollection = Recollection(store, store.migrations * plan.migrate_every)
        self.shared = recollection.shared()
        self.courses = [self._course(island) for island in islands]
        for course in self.courses:
            recollection.remind(course)
        self.front = store.front()
        self.standing_generation, self.candidates, self.fitted = store.totals()
        self.seconds_before = store.seconds
        self.started = time.monotonic()

    def _settled(self) -> tuple[Island, ...]:
        """New islands, all of them stored at once: a run may be left when only some have a generation."""
        islands = tuple(map(Island, range(self.plan.islands)))
        with self.store.transaction():
            self.store.save_islands(islands)
        return islands

    def seconds(self) -> float:
        """For how long the run has searched."""
        return self.seconds_before + time.monotonic() - self.started

    @property
    def generation(self) -> int:
        """What all islands have reached."""
        return min(course.island.generation for course in self.courses)

    def run(self) -> str:
        """Breeds until a budget is used up, describes the front and tests it; returns which budget it was."""
        self.fit_baselines()
        # The minutes are the search's own: its baselines may take longer than a short budget.
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
        """Fits what is listed, formulas that are described and baselines, to the test materials."""
        total, lanes = transfer_lanes(self.plan, self.store)
        if lanes:
            self.watcher.stage("test materials", total)
            self._run(lanes, stop=lambda: False)

    def _search(self) -> str:
        """Every turn of the loop is what lies between two migrations."""
        last, every = self.plan.last_generation, self.plan.migrate_every
        per_generation = self.plan.breeding.size * self.plan.islands
        self.watcher.stage("searching", None if last is None else last * per_generation)
        self.watcher.step(self.candidates)
        while last is None or self.generation < last:
            due = (self.store.migrations + 1) * every
            target = due if last is None else min(due, last)
            if not self._run((course.until(target) for course in self.courses), stop=self._late):
                return "minutes"
            if self.generation == due:
                self._migrate()
        return "generations" if last == self.plan.budget.generations else "candidates"

    def _migrate(self) -> None:
        """The best of every island move on, and all islands learn what each has found."""
        self.shared.join(course.memory for course in self.courses)
        islands = migrate([course.island for course in self.courses], self.plan.migrants)
        with self.store.transaction():
            self.store.save_islands(islands)
            self.store.keep_confirmed(self.shared.front)
            self.store.save_migrations(self.store.migrations + 1)
        self.courses = [self._course(island) for island in islands]

    def _course(self, island: Island) -> Course:
        return Course(self.plan, self.store, island, self.shared, told=self._told, seconds=self.seconds)

    def _run(self, lanes: Iterable[Lane], stop: Callable[[], bool]) -> bool:
        def stop_and_note() -> bool:
            self._note_incidents()
            return stop()

        try:
            return run_lanes(self.executor, lanes, done=self._done, stop=stop_and_note)
        finally:
            self._note_incidents()

    def _late(self) -> bool:
        return self.plan.budget.seconds is not None and self.seconds() >= self.plan.budget.seconds

    # what others are told

    def _done(self, done: Done) -> None:
        if done.job.kind != "confirm":
            self.watcher.step(1)

    def _told(self, row: Generation, screened: int, confirmed: list[Member]) -> None:
        """A generation of an island is stored."""
        before = self.standing_generation
        self.candidates += row.candidates
        self.fitted += row.fitted
        self.front = self.front.updated(confirmed)
        self.watcher.step(row.candidates - screened)
        if self.generation > before:
            self.standing_generation = self.generation
            self.watcher.generation(
                Standing(self.generation, self.candidates, self.fitted, self.seconds(), self.front)
            )

    def _note_incidents(self) -> None:
        """Whatever happened to the cluster goes into the event log."""
        incidents = self.executor.incidents()
        if incidents:
            with self.store.transaction():
                for incident in incidents:
                    self.store.log(incident.kind, incident.detail)
            for incident in incidents:
                self.watcher.incident(incident)
