"""Whatever happens, each item is delivered once, and a log repeats what happened."""

from __future__ import annotations

import json
import random

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, precondition, rule

from tests.workers.simulated import HANG, SimulatedCluster
from workers.context import Raised
from workers.dispatch.events import Abandoned, Disconnected, Dropped, Erred, Finished, ResultLost, VersionsDiffer
from workers.dispatch.replay import replay
from workers.jobs import Failure

SECONDS = st.sampled_from([0.001, 0.1, 3.0])
ANY = st.integers(0, 10**6)


class Sequences(RuleBasedStateMachine):
    """Every order of events that a cluster could cause; `Trial` checks the invariants after each."""

    def __init__(self) -> None:
        super().__init__()
        self.dice = random.Random(0)
        self.cluster = SimulatedCluster(3, lambda n: Raised("OSError") if self.dice.random() < 0.05 else n)
        self.trial = self.cluster.trial
        self.expected: dict[int, int] = {}

    def worker(self, number: int) -> str:
        return sorted(self.cluster.queues)[number % len(self.cluster.queues)]

    def withdrawn(self, number: int) -> int:
        """The key of a task that the cluster has no more from now on."""
        task = self.cluster.tasks[number % len(self.cluster.tasks)]
        for queue in self.cluster.queues.values():
            queue[:] = [other for other in queue if other is not task]
        self.cluster.running = {name: t for name, t in self.cluster.running.items() if t is not task}
        return task.key

    @rule(items=st.integers(0, 40), seconds=SECONDS, kind=st.sampled_from(["screen", "confirm"]))
    def ask(self, items: int, seconds: float, kind: str) -> None:
        self.cluster.place(self.trial.ask(items, seconds, f"{kind} island {self.trial.jobs}"))
        self.expected[self.trial.jobs - 1] = items

    @rule(number=ANY)
    def begin(self, number: int) -> None:
        self.cluster.begin(self.worker(number))

    @rule(number=ANY, per_item=SECONDS)
    def begin_and_end(self, number: int, per_item: float) -> None:
        self.cluster.begin(self.worker(number))
        self.cluster.end(self.worker(number), per_item)

    @rule(number=ANY)
    def kill(self, number: int) -> None:
        self.cluster.kill(self.worker(number))

    @rule(number=ANY)
    def leave(self, number: int) -> None:
        self.cluster.leave(self.worker(number))

    @rule(number=ANY)
    def mismatch(self, number: int) -> None:
        self.cluster.tell(VersionsDiffer(self.trial.now, {self.worker(number): "is old"}))

    @rule()
    def list_workers(self) -> None:
        self.cluster.list_workers()

    @rule()
    def lose_scheduler(self) -> None:
        self.cluster.lose_scheduler()

    @precondition(lambda self: self.cluster.tasks)
    @rule(number=ANY)
    def drop(self, number: int) -> None:
        self.cluster.tell(Dropped(self.trial.now, self.withdrawn(number), "w0"))

    @precondition(lambda self: self.cluster.tasks)
    @rule(number=ANY)
    def lose_result(self, number: int) -> None:
        self.cluster.tell(ResultLost(self.trial.now, self.withdrawn(number)))

    @precondition(lambda self: self.cluster.tasks)
    @rule(number=ANY, bad_input=st.booleans(), differs=st.booleans())
    def err(self, number: int, bad_input: bool, differs: bool) -> None:
        faults = {self.worker(number): "is old"} if differs else {}
        self.cluster.tell(Erred(self.trial.now, self.withdrawn(number), "?", "w0", bad_input, faults))

    @rule(key=st.integers(0, 100))
    def hear_of_what_is_over(self, key: int) -> None:
        if key not in self.trial.state.out:
            self.cluster.tell(Finished(self.trial.now, key, 1.0), [0])

    @rule(seconds=st.sampled_from([0.1, 1.0, HANG, 100 * HANG]))
    def pass_time(self, seconds: float) -> None:
        self.cluster.pass_time(seconds)

    @rule()
    def abandon(self) -> None:
        self.cluster.tell(Abandoned(self.trial.now))
        self.expected.clear()

    def teardown(self) -> None:
        # A new scheduler has forgotten which workers have another version.
        self.cluster.lose_scheduler()
        self.cluster.run_to_the_end()
        self.trial.require_nothing_left()
        for job, items in self.expected.items():
            results = self.trial.of_job(job)
            assert results.keys() == set(range(items))
            assert all(isinstance(result, Failure) or result == index for index, result in results.items())
        assert [event for event, before, now in replay(self.log()) if before != now] == []

    def log(self) -> list[str]:
        return "".join(self.trial.lines).splitlines(keepends=True)


Sequences.TestCase.settings = settings(
    max_examples=100, stateful_step_count=60, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
TestSequences = Sequences.TestCase


def a_log() -> list[str]:
    sequences = Sequences()
    sequences.ask(20, 0.1, "screen")
    sequences.begin_and_end(0, 0.1)
    sequences.begin(1)
    sequences.cluster.tell(Disconnected(3.0))
    return sequences.log()


def test_a_log_shows_what_has_changed() -> None:
    log = a_log()
    changed = next(n for n, line in enumerate(log) if json.loads(line)[0] == "Submit")
    log[changed] = log[changed].replace('"suspect": false', '"suspect": true')
    differing = [event for event, before, now in replay(log) if before != now]
    assert [type(event).__name__ for event in differing] == ["Asked"]


def test_a_log_of_a_process_that_was_killed_is_replayed_as_far_as_it_goes() -> None:
    log = a_log()
    for length in range(2, len(log)):
        incomplete = [*log[:length], log[length][:-5]]
        assert all(before == now for _, before, now in replay(incomplete))
