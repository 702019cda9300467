"""The log of a dispatcher: every event and every instruction, a line of JSON each, and the check of it.

A process that has the environment variable WORKERS_LOG writes one file per executor to that folder and checks the
invariants after every event; `python -m workers.dispatch.replay FILE` repeats what is in such a file.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import fields
from pathlib import Path
from typing import get_args
from uuid import uuid4

from workers.dispatch.dispatcher import Dispatcher
from workers.dispatch.events import Event, Instruction
from workers.dispatch.invariants import check_invariants
from workers.dispatch.state import Rules

FOLDER = "WORKERS_LOG"

EVENTS = {kind.__name__: kind for kind in get_args(Event)}

Answer = Callable[[Event], list[Instruction]]


def to_line(value: Rules | Event | Instruction) -> str:
    """One line of JSON: the name of a class and its fields, a range as "first:end"."""
    record = {field.name: getattr(value, field.name) for field in fields(value)}
    return json.dumps([type(value).__name__, record], default=lambda indices: f"{indices.start}:{indices.stop}")


def logged(dispatcher: Dispatcher, write: Callable[[str], object]) -> Answer:
    """`dispatcher.handle` that writes its lines and checks the invariants. An event is written before it acts."""
    head = [to_line(dispatcher.state.rules) + "\n"]

    def handle(event: Event) -> list[Instruction]:
        write("".join([*head, to_line(event) + "\n"]))
        head.clear()
        instructions = dispatcher.handle(event)
        write("".join(to_line(instruction) + "\n" for instruction in instructions))
        check_invariants(dispatcher.state, instructions)
        return instructions

    return handle


def handler(dispatcher: Dispatcher) -> Answer:
    """How an executor asks its dispatcher: with a log where WORKERS_LOG names a folder."""
    folder = os.environ.get(FOLDER)
    if folder is None:
        return dispatcher.handle
    path = Path(folder, f"dispatch-{os.getpid()}-{uuid4().hex[:8]}.jsonl")

    def append(text: str) -> None:
        with path.open("a") as file:
            file.write(text)

    return logged(dispatcher, append)


def replay(lines: Iterable[str]) -> Iterator[tuple[Event, list[str], list[str]]]:
    """For each event of a log: the instructions that it led to then, and those that it leads to now, as lines.

    A killed process leaves an incomplete end: the last event is compared as far as its instructions were written.
    Raises `AssertionError` where an invariant is violated.
    """
    records = [json.loads(line) for line in lines if line.endswith("\n")]
    dispatcher = Dispatcher(Rules(**records[0][1]))
    positions = [n for n, (name, _) in enumerate(records) if name in EVENTS]
    for begin, end in zip(positions, [*positions[1:], len(records)], strict=False):
        name, values = records[begin]
        event = EVENTS[name](**values)
        instructions = dispatcher.handle(event)
        check_invariants(dispatcher.state, instructions)
        before = [json.dumps(record) for record in records[begin + 1 : end]]
        now = [to_line(instruction) for instruction in instructions]
        yield event, before, now if end < len(records) else now[: len(before)]


def main(path: str) -> int:
    """Prints a log; ends with status 1 at the first event that leads to other instructions now."""
    with open(path) as file:
        for event, before, now in replay(file):
            print(to_line(event), *(f"    {line}" for line in now), sep="\n")
            if before != now:
                print("before it was:", *(f"    {line}" for line in before), sep="\n")
                return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
