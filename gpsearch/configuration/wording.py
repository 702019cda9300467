"""How mistakes, values and names appear in messages: each on one line, with the nearest known name."""

import difflib
from collections.abc import Iterable
from dataclasses import dataclass

LONGEST = 60
"""Characters of a value, digits of a number."""
MOST = 100
"""Problems that a message lists."""

Place = tuple[str | int, ...]
"""The way to a value: keys, and indices of lists."""


@dataclass(frozen=True)
class Mistake:
    """What is wrong with the value at a place."""

    place: Place
    line: int
    text: str


def message(mistakes: list[Mistake], source: str) -> str:
    """The mistakes of a file, one per line, from its first line to its last."""
    ordered = sorted(mistakes, key=lambda mistake: mistake.line)
    lines = [f"{source}:{p.line}: {key_path(p.place)}: {p.text}" for p in ordered[:MOST]]
    more = len(ordered) - MOST
    return "\n".join([*lines, f"{source}: {more} more problems"] if more > 0 else lines)


def key_path(place: Place) -> str:
    """`search.islands`, `materials[2]`."""
    parts = (f"[{part}]" if isinstance(part, int) else f".{plain(part)}" for part in place)
    return "".join(parts).removeprefix(".")


def shown(value: object) -> str:
    """A value in YAML: `true`, `null`, `'four'`, shortened where it is long."""
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    if isinstance(value, str):
        return repr(value) if len(value) <= LONGEST else repr(value[:LONGEST]) + "..."
    if isinstance(value, int) and abs(value) >= 10**LONGEST:
        return f"a number of more than {LONGEST} digits"
    if isinstance(value, dict):
        return "{" + _cut(", ".join(f"{key}: {shown(item)}" for key, item in _first(value.items()))) + "}"
    if isinstance(value, list | tuple):
        return "[" + _cut(", ".join(shown(item) for item in _first(value))) + "]"
    return repr(value)


def plain(text: str) -> str:
    """A key or a path; in quotes where it is empty, has spaces at its ends, or cannot be printed."""
    cut = text if len(text) <= 4 * LONGEST else text[: 4 * LONGEST] + "..."
    return cut if cut.isprintable() and cut == cut.strip() and cut else repr(cut)


def nearest(text: str, names: Iterable[str], cutoff: float = 0.6) -> str | None:
    """The name that was probably meant."""
    near = difflib.get_close_matches(text[:LONGEST], list(names), n=1, cutoff=cutoff)
    return near[0] if near else None


def listed(names: Iterable[str]) -> str:
    return ", ".join(names)


def _first(items: Iterable) -> list:
    return [item for item, _ in zip(items, range(10), strict=False)]


def _cut(text: str) -> str:
    return text if len(text) <= LONGEST else text[:LONGEST] + "..."
