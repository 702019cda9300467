"""Which items go out together, when they go out again, and when one is given up: the logic, without a cluster.

A `Dispatcher` is a function of its events: it has no clock, no random numbers and no I/O, and the same events give
the same instructions in any process. `replay` relies on it.

Items travel in batches of about `TASK_SECONDS`. A batch that loses its process twice, or hangs, is halved until
the item that is the cause is alone; that one is given up after `DEATHS` processes or `HANGS` time limits. A batch
that takes much longer than it should goes out once more, to another worker: functions are pure, so the first
result counts. Work that is lost with a worker or a scheduler goes out again. Workers that have another version of
the package get no work. Where scheduler or workers are away for longer than the rules allow, the work stops.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from workers.context import RAISES
from workers.dispatch.events import (
    Abandoned,
    Asked,
    Began,
    Cancel,
    Connected,
    Deliver,
    Disconnect,
    Disconnected,
    Dropped,
    Erred,
    Event,
    Finished,
    GiveUp,
    Instruction,
    Record,
    ResultLost,
    Stop,
    Submit,
    Tick,
    Unreachable,
    VersionsDiffer,
    WorkerLeft,
    WorkersListed,
)
from workers.dispatch.state import AHEAD, DEATHS, HANGS, STRIKES, Attempt, Batch, Rules, State, Work
from workers.errors import failure_text


class Dispatcher:
    """Answers each event with instructions. It owns `state`: read it, and leave it unchanged."""

    def __init__(self, rules: Rules) -> None:
        self.state = State(rules)
        self._instructions: list[Instruction] = []

    def handle(self, event: Event) -> list[Instruction]:
        """What to do now, in this order. After a `Stop` nothing goes out until the next event."""
        self.state.now = max(self.state.now, event.now)
        self._instructions = []
        _HANDLERS[type(event)](self, event)
        if not any(type(instruction) is Stop for instruction in self._instructions):
            self._send()
        return self._instructions

    # what is asked for

    def _asked(self, event: Asked) -> None:
        if event.items:
            work = Work(event.job, event.label, event.kind, event.items, event.seconds)
            self.state.works[work.number] = work
            self.state.outstanding += work.items
            self._wait(Batch(work, range(work.items)), first=False)

    def _abandoned(self, _event: Abandoned) -> None:
        state = self.state
        self._instructions += [Cancel(key) for key in state.out]
        for kept in (state.works, state.waiting, state.out, state.late, state.raised):
            kept.clear()
        state.outstanding = state.items_waiting = 0

    # what goes out

    def _send(self) -> None:
        state = self.state
        while state.waiting and state.connected and len(state.out) - len(state.late) < AHEAD * state.slots:
            batch = self._next_batch()
            batch.limit = state.limit(batch)
            self._submit(batch)

    def _next_batch(self) -> Batch:
        """The first that waits, or as many of its items as make a batch."""
        state = self.state
        batch = state.waiting[0]
        size = state.size(batch.work)
        if len(batch.indices) <= size:
            state.waiting.popleft()
            state.items_waiting -= len(batch.indices)
            return batch
        state.waiting[0] = batch.part(batch.indices[size:])
        state.items_waiting -= size
        return batch.part(batch.indices[:size])

    def _submit(self, batch: Batch) -> None:
        state = self.state
        key = state.next_key
        state.next_key += 1
        state.out[key] = batch
        batch.attempts[key] = Attempt(state.now)
        stuck, workers = set(state.stuck()), None
        if state.mismatched or stuck:
            workers = tuple(address for address in state.usable if address not in stuck) or None
        suspect = batch.strikes > 0 or batch.doubted
        self._instructions.append(Submit(key, batch.work.number, batch.indices, batch.limit, suspect, workers))

    def _wait(self, batch: Batch, *, first: bool = True) -> None:
        """A batch is to go out, before or after all others."""
        self.state.items_waiting += len(batch.indices)
        (self.state.waiting.appendleft if first else self.state.waiting.append)(batch)

    def _repeat(self, batch: Batch) -> None:
        self.state.retries += 1
        self._wait(batch)

    def _withdraw(self, batch: Batch, finished: int | None = None) -> None:
        """No task of a batch counts any more; all but the one that has `finished` may still run."""
        for key in batch.attempts:
            del self.state.out[key]
            self.state.late.pop(key, None)
            if key != finished:
                self._instructions.append(Cancel(key))
        batch.attempts.clear()

    def _result_lost(self, event: ResultLost) -> None:
        self._take_back(event.key)

    def _take_back(self, key: int) -> Batch | None:
        """A task will have no results; its batch goes out again where no other task has it. None: not needed."""
        batch = self.state.out.pop(key, None)
        if batch is not None:
            self.state.late.pop(key, None)
            del batch.attempts[key]
            if not batch.attempts:
                self._repeat(batch)
        return batch

    # what tasks come to

    def _began(self, event: Began) -> None:
        if batch := self.state.out.get(event.key):
            attempt = batch.attempts[event.key]
            attempt.worker, attempt.began = event.worker, self.state.now
        self.state.latest_start = self.state.now

    def _finished(self, event: Finished) -> None:
        """Items that raised are tried again, elsewhere if possible."""
        batch = self.state.out.get(event.key)
        if batch is None:
            return
        self._withdraw(batch, finished=event.key)
        self._measure(batch, event.seconds)
        raised = dict(event.raised)
        positions: Sequence[int] = range(len(batch.indices))
        indices = batch.indices
        if raised:
            positions = tuple(position for position in positions if position not in raised)
            indices = tuple(batch.indices[position] for position in positions)
        if positions:
            self._instructions.append(Deliver(batch.work.number, indices, positions))
            self._done(batch.work, indices)
        for position, text in raised.items():
            item = (batch.work.number, batch.indices[position])
            self.state.raised[item] += 1
            if self.state.raised[item] < RAISES:
                self._repeat(Batch(batch.work, (item[1],)))
            else:
                self._give_up(batch.work, item[1], f"raised {text}")

    def _measure(self, batch: Batch, seconds: float) -> None:
        """The cost of a kind of work follows what its latest batches took."""
        per_item = seconds / len(batch.indices)
        before = self.state.seconds.get(batch.work.kind)
        self.state.seconds[batch.work.kind] = per_item if before is None else 0.8 * before + 0.2 * per_item

    def _done(self, work: Work, indices: Sequence[int]) -> None:
        state = self.state
        work.finish(indices)
        state.outstanding -= len(indices)
        if state.raised:
            for index in indices:
                state.raised.pop((work.number, index), None)
        if not work.left:
            del state.works[work.number]

    def _give_up(self, work: Work, index: int, reason: str) -> None:
        self._instructions.append(GiveUp(work.number, index, reason))
        self._done(work, (index,))

    def _dropped(self, event: Dropped) -> None:
        state = self.state
        batch = state.out.get(event.key)
        if batch is None:
            return
        attempt = batch.attempts[event.key]
        batch.doubted = True
        batch.unbegun += attempt.began is None and state.latest_start < attempt.submitted and not batch.strikes
        self._take_back(event.key)
        # No item is the cause where a batch was dropped twice and nothing at all began meanwhile.
        wait_seconds, began = state.rules.wait_seconds, max(state.opened or 0.0, state.latest_start)
        if batch.unbegun >= 2 and state.now - began > wait_seconds:
            self._stop(
                f"{batch.work.label}: for {wait_seconds:g} s worker processes have died before they could"
                f" begin, the last at {event.worker}: see its log; data that does not fit into its memory is the"
                " usual reason"
            )

    def _erred(self, event: Erred) -> None:
        """The items are not the cause: the place is, or what the whole task needs."""
        if event.faults:
            self._avoid(event.faults)
        batch = self._take_back(event.key)
        if batch is None or event.faults:
            return
        batch.errors += 1
        if event.bad_input or batch.errors >= 2:
            label, index = batch.work.label, batch.indices[0]
            self._stop(failure_text(label, index, event.error, event.where, bad_input=event.bad_input))

    def _ticked(self, _event: Tick) -> None:
        """Looks for what hangs or is late, and for how long there have been no workers."""
        state = self.state
        for batch in list(dict.fromkeys(state.out.values())):
            batch.limit = min(batch.limit, state.limit(batch))
            began = [attempt.began for attempt in batch.attempts.values() if attempt.began is not None]
            if began and state.now - min(began) > batch.limit:
                self._hung(batch)
        state.late = state.late_tasks()
        for batch in state.to_repeat():
            state.retries += 1
            self._submit(batch)
        if state.connected and self._away() > state.rules.wait_seconds:
            self._stop(
                f"{state.rules.place(0)} for {state.rules.wait_seconds:g} s, with {self._left()}: start some,"
                " then start again; what was stored is kept"
            )

    def _hung(self, batch: Batch) -> None:
        batch.strikes += 1
        self._withdraw(batch)
        if len(batch.indices) > 1:
            self._halve(batch)
            return
        batch.hangs += 1
        if batch.hangs < HANGS:
            self._repeat(batch)
        else:
            reason = f"did not end within {batch.limit:g} s, {batch.hangs} times"
            self._give_up(batch.work, batch.indices[0], reason)

    def _halve(self, batch: Batch) -> None:
        middle = len(batch.indices) // 2
        for half in (batch.indices[middle:], batch.indices[:middle]):
            self._repeat(Batch(batch.work, half, strikes=1, doubted=True))

    # workers

    def _worker_left(self, event: WorkerLeft) -> None:
        """Where a worker died, what had begun there is suspected, and what merely waited there is not."""
        state = self.state
        if event.died:
            self._instructions.append(Record("lost", event.worker))
        begun = [key for key, batch in state.out.items() if batch.attempts[key].worker == event.worker]
        for key in begun:
            batch = state.out.get(key)
            if batch is None:
                continue
            batch.attempts[key].worker = batch.attempts[key].began = None
            state.late.pop(key, None)
            if event.died:
                batch.strikes += 1
                state.retries += 1
                self._judge(batch)
        if event.died and not begun:
            for key in event.keys:
                if batch := state.out.get(key):
                    batch.doubted = True

    def _judge(self, batch: Batch) -> None:
        """After a death: the cluster repeats a batch by itself, unless it is halved or given up."""
        if len(batch.indices) > 1:
            if batch.strikes >= STRIKES:
                self._withdraw(batch)
                self._halve(batch)
        elif batch.strikes >= DEATHS:
            self._withdraw(batch)
            reason = f"its worker process died, {batch.strikes} times; memory is the usual reason"
            self._give_up(batch.work, batch.indices[0], reason)

    def _workers_listed(self, event: WorkersListed) -> None:
        state, threads = self.state, event.threads
        joined, left = threads.keys() - state.threads.keys(), state.threads.keys() - threads.keys()
        if joined or left:
            changes = [f"{len(joined)} joined"] * bool(joined) + [f"{len(left)} left"] * bool(left)
            self._instructions.append(Record("workers", ", ".join([*changes, f"{len(threads)} there"])))
        state.mismatched &= threads.keys()
        self._use(threads)

    def _versions_differ(self, event: VersionsDiffer) -> None:
        self._avoid(event.faults)

    def _avoid(self, faults: Mapping[str, str]) -> None:
        """Workers that have another version of the package get no more work."""
        for address in sorted(faults.keys() - self.state.mismatched):
            self._instructions.append(Record("refused", f"worker {address} {faults[address]}; it gets no work"))
        self.state.mismatched |= faults.keys()
        self._use(self.state.threads)

    def _use(self, threads: Mapping[str, int]) -> None:
        state = self.state
        state.threads = dict(threads)
        state.usable = {address: n for address, n in threads.items() if address not in state.mismatched}
        state.slots = sum(state.usable.values())
        if state.usable:
            state.without_since = None
        elif state.without_since is None:
            state.without_since = state.now

    # the scheduler

    def _connected(self, event: Connected) -> None:
        """Where the scheduler or every worker has another version of the package, nothing can be done there."""
        state = self.state
        fault = f"scheduler {event.scheduler_fault}" if event.scheduler_fault else ""
        if event.faults and event.faults.keys() >= event.threads.keys():
            place, text = next(iter(event.faults.items()))
            fault = f"worker {place} {text}"
        if fault and state.opened is None:
            self._stop(fault)
        elif fault:
            self._instructions.append(Disconnect())
            self._not_reached(fault)
        else:
            again, away = state.opened is not None, self._away()
            state.opened = state.opened if again else state.now
            state.connected, state.without_since = True, None
            state.mismatched.clear()
            self._use(event.threads)
            self._avoid(event.faults)
            if again:
                place = state.rules.place(len(state.usable))
                self._instructions.append(Record("scheduler", f"back after {away:.0f} s: {place}"))

    def _disconnected(self, _event: Disconnected) -> None:
        """All that is out goes out again through another connection, and no item is the cause."""
        state = self.state
        batches = list(dict.fromkeys(state.out.values()))
        state.out.clear()
        state.late.clear()
        for batch in reversed(batches):
            batch.attempts.clear()
            self._repeat(batch)
        state.connected, state.without_since = False, state.now
        lost = f"lost the connection to {state.rules.place(len(state.threads))}"
        self._instructions += [Disconnect(), Record("scheduler", lost)]

    def _unreachable(self, event: Unreachable) -> None:
        self._not_reached(event.reason)

    def _not_reached(self, reason: str) -> None:
        state = self.state
        if state.rules.scheduler is None or self._away() > state.rules.wait_seconds:
            place = state.rules.place(len(state.threads))
            self._stop(f"lost the connection to {place} with {self._left()}: {reason}; what was stored is kept")

    def _away(self) -> float:
        """For how long there has been no worker or no scheduler."""
        return 0.0 if self.state.without_since is None else self.state.now - self.state.without_since

    def _left(self) -> str:
        return f"{self.state.outstanding} pieces of work outstanding"

    def _stop(self, reason: str) -> None:
        self._instructions.append(Stop(reason))


_HANDLERS: dict[type, Callable[[Dispatcher, Any], None]] = {
    Asked: Dispatcher._asked,
    Abandoned: Dispatcher._abandoned,
    Tick: Dispatcher._ticked,
    Connected: Dispatcher._connected,
    Unreachable: Dispatcher._unreachable,
    Disconnected: Dispatcher._disconnected,
    WorkersListed: Dispatcher._workers_listed,
    VersionsDiffer: Dispatcher._versions_differ,
    WorkerLeft: Dispatcher._worker_left,
    Began: Dispatcher._began,
    Finished: Dispatcher._finished,
    ResultLost: Dispatcher._result_lost,
    Dropped: Dispatcher._dropped,
    Erred: Dispatcher._erred,
}
