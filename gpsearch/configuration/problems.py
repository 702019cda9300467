"""From the validator's errors to lines that name the key path, what was found and what is allowed."""

import re
from collections.abc import Iterator, Mapping
from typing import Any, get_args

from pydantic import ValidationError

from gpsearch.configuration.document import Document, Place, Problem
from gpsearch.configuration.fields import Section
from gpsearch.configuration.model import Configuration
from gpsearch.configuration.wording import listed, nearest, plain, shown

MOST = 100
"""Problems that a message lists."""

Keys = tuple[str, ...]


def _describe(model: type[Section], at: Keys = ()) -> Iterator[tuple[Keys, str]]:
    """What every key allows. A section that has kinds is followed by its kind, as in the validator's places."""
    for name, field in model.model_fields.items():
        yield (*at, name), field.description or ""
        for member in (field.annotation, *get_args(field.annotation)):
            if isinstance(member, type) and issubclass(member, Section):
                kind = member.model_fields.get("kind")
                yield from _describe(member, (*at, name, *([kind.default] if kind else [])))


ALLOWED: Mapping[Keys, str] = dict(_describe(Configuration))


def message(problems: list[Problem], source: str) -> str:
    """The problems of a file, one per line, from its first line to its last."""
    ordered = sorted(problems, key=lambda problem: problem.line)
    lines = [f"{source}:{p.line}: {key_path(p.place)}: {p.text}" for p in ordered[:MOST]]
    more = len(ordered) - MOST
    return "\n".join([*lines, f"{source}: {more} more problems"] if more > 0 else lines)


def key_path(place: Place) -> str:
    """`search.islands`, `materials[2]`."""
    parts = (f"[{part}]" if isinstance(part, int) else f".{plain(part)}" for part in place)
    return "".join(parts).removeprefix(".")


def validation_problems(error: ValidationError, document: Document) -> list[Problem]:
    """What the validator found, save in places that the document has refused already."""
    refused = {problem.place for problem in document.problems}
    problems = []
    for number, found in enumerate(filter(_is_telling, error.errors(include_url=False))):
        place = _place(found["loc"])
        if found["type"] != "extra_forbidden" and any(place[:end] in refused for end in range(len(place) + 1)):
            continue
        # Only what a message will list is worth the search for the nearest key
        text = _text(found) if number < 2 * MOST else "is wrong"
        problems.append(Problem(place, document.line(place), text))
    return problems


def _is_telling(found: Any) -> bool:
    """Whether an error is more than the echo of others: a list whose items are refused counts as too short."""
    return found["type"] != "too_short" or not found["input"]


def _place(loc: Place) -> Place:
    """The place in the file: the validator's, without the kind of a section that has kinds."""
    return tuple(part for end, part in enumerate(loc) if not _is_kind(loc[: end + 1]))


def _is_kind(loc: Place) -> bool:
    keys = _keys(loc)
    return keys not in ALLOWED and (*keys, "kind") in ALLOWED


def _keys(loc: Place) -> Keys:
    return tuple(part for part in loc if isinstance(part, str))


def _text(found: Any) -> str:
    loc, kind = found["loc"], found["type"]
    if kind == "extra_forbidden":
        return _unknown_key(_keys(loc))
    if kind in ("value_error", "item"):
        return re.sub(r"^Value error, ", "", found["msg"])
    allowed = ALLOWED.get(_keys(loc)) or ALLOWED.get(_keys(loc)[:-1], "")
    if kind in ("missing", "union_tag_not_found"):
        return f"is missing; allowed: {allowed}"
    return f"found {shown(found['input'])}; allowed: {allowed}"


def _unknown_key(keys: Keys) -> str:
    """The nearest key of the same section, or else of another one."""
    *section, key = keys
    siblings = [known[-1] for known in ALLOWED if list(known[:-1]) == section and not _is_kind(known)]
    if near := nearest(key, siblings):
        return f"no such key; did you mean {near}?"
    elsewhere = {known[-1]: known for known in ALLOWED if _place(known) != _place(keys)}
    if near := nearest(key, elsewhere, cutoff=0.8):
        return f"no such key; did you mean {key_path(_place(elsewhere[near]))}?"
    return f"no such key; there {'are' if len(siblings) > 1 else 'is'} {listed(siblings)}"
