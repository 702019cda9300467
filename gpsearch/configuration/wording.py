"""How values and names appear in messages: short, on one line, with the nearest known name."""

import difflib
from collections.abc import Iterable

LONGEST = 60


def shown(value: object) -> str:
    """A value as a user wrote it, more or less: `true`, `null`, `'four'`, cut where it is long."""
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
    """A key or a path, in quotes only where it would not show as it is."""
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
