"""What always holds of a dispatcher, whatever has happened: the tests check it after every event."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from workers.context import RAISES
from workers.dispatch.events import Cancel, Instruction, Stop, Submit
from workers.dispatch.state import AHEAD, DEATHS, HANGS, STRIKES, State


def check_invariants(state: State, instructions: Sequence[Instruction] = ()) -> None:
    """Raises `AssertionError`, naming what does not hold after an event that was answered by `instructions`."""
    violations = [*_of_items(state), *_of_batches(state), *_of_workers(state), *_of_answers(state, instructions)]
    if violations:
        raise AssertionError("; ".join(violations))


def _of_items(state: State) -> Iterator[str]:
    """Each item that was asked for is in exactly one place: waiting, out or done."""
    places: Counter[tuple[int, int]] = Counter()
    for batch in (*state.waiting, *dict.fromkeys(state.out.values())):
        places.update((batch.work.number, index) for index in batch.indices)
    for work in state.works.values():
        places.update((work.number, index) for index in range(work.items) if work.done[index])
        if not 0 < work.left == work.items - sum(work.done):
            yield f"job {work.number} counts {work.left} items left of {work.items}"
    asked = {(work.number, index) for work in state.works.values() for index in range(work.items)}
    for item in asked - places.keys():
        yield f"item {item} is lost"
    for item, count in places.items():
        if item not in asked or count != 1:
            yield f"item {item} is in {count} places"
    if state.outstanding != sum(work.left for work in state.works.values()):
        yield f"{state.outstanding} items are said to be outstanding"
    if state.items_waiting != sum(len(batch.indices) for batch in state.waiting):
        yield f"{state.items_waiting} items are said to wait"
    for (job, index), count in state.raised.items():
        if job not in state.works or state.works[job].done[index] or not 0 < count < RAISES:
            yield f"item {(job, index)} is said to have raised {count} times"


def _of_batches(state: State) -> Iterator[str]:
    for batch in state.waiting:
        if batch.attempts:
            yield f"a batch of job {batch.work.number} waits and is out"
    for key, batch in state.out.items():
        if key not in batch.attempts or any(state.out.get(other) is not batch for other in batch.attempts):
            yield f"task {key} is not an attempt of its batch, or another attempt is not out"
        if len(batch.attempts) > 2:
            yield f"the batch of task {key} is out {len(batch.attempts)} times"
        if not 0 <= key < state.next_key:
            yield f"task {key} was never sent out"
    for batch in (*state.waiting, *state.out.values()):
        alone = len(batch.indices) == 1
        if (
            not batch.indices
            or batch.strikes >= (DEATHS + HANGS - 1 if alone else STRIKES)
            or batch.hangs >= HANGS
        ):
            yield f"{list(batch.indices)} of job {batch.work.number} should have been halved or given up"
        if batch.hangs and not alone:
            yield f"{list(batch.indices)} of job {batch.work.number} hung together and were not halved"
    if not state.late.keys() <= state.out.keys():
        yield "a late task is not out"


def _of_workers(state: State) -> Iterator[str]:
    expected = {address: n for address, n in state.threads.items() if address not in state.mismatched}
    if state.usable != expected or state.slots != sum(expected.values()):
        yield f"usable workers are {state.usable}, not {expected}"
    if state.out and not state.connected:
        yield "tasks are out and no scheduler is there"
    if state.opened is not None and (state.without_since is None) != (state.connected and bool(state.usable)):
        yield f"without workers since {state.without_since}, with {len(state.usable)} of them"


def _of_answers(state: State, instructions: Sequence[Instruction]) -> Iterator[str]:
    submitted = [instruction for instruction in instructions if isinstance(instruction, Submit)]
    for submit in submitted:
        if submit.key not in state.out or list(state.out[submit.key].indices) != list(submit.indices):
            yield f"task {submit.key} is sent out and not noted"
    if len({submit.key for submit in submitted}) < len(submitted):
        yield "a key is used twice"
    for instruction in instructions:
        if isinstance(instruction, Cancel) and instruction.key in state.out:
            yield f"task {instruction.key} is cancelled and out"
    stopped = any(isinstance(instruction, Stop) for instruction in instructions)
    room = AHEAD * state.slots - (len(state.out) - len(state.late))
    if state.waiting and state.connected and room > 0 and not stopped:
        yield f"{state.items_waiting} items wait while there is room for {room} tasks"
