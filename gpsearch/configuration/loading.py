"""From a file to a configuration, or to one error that lists everything that is wrong with the file."""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, get_args

from pydantic import ValidationError

from gpsearch.configuration.document import Document, read_document
from gpsearch.configuration.fields import Section, Surroundings
from gpsearch.configuration.files import read_text
from gpsearch.configuration.model import Configuration
from gpsearch.configuration.wording import MOST, Mistake, Place, key_path, listed, message, nearest, plain, shown
from gpsearch.errors import GpsearchError

Keys = tuple[str, ...]
"""A key and the sections around it, without indices of lists."""


def _describe(model: type[Section], at: Keys = ()) -> Iterator[tuple[Keys, str]]:
    """Every key and what it allows. After a section that has kinds comes its kind, as in pydantic's `loc`."""
    for name, field in model.model_fields.items():
        yield (*at, name), field.description or ""
        for member in (field.annotation, *get_args(field.annotation)):
            if isinstance(member, type) and issubclass(member, Section):
                kind = member.model_fields.get("kind")
                yield from _describe(member, (*at, name, *([kind.default] if kind else [])))


ALLOWED: Mapping[Keys, str] = dict(_describe(Configuration))


def load_configuration(path: Path) -> Configuration:
    """The configuration in a YAML file; relative paths in it count from the file's folder.

    Raises `GpsearchError`, a line per problem: file, line, key path, what was found and what is allowed.
    """
    path = Path(path)
    return parse_configuration(read_text(path), source=plain(str(path)), folder=path.absolute().parent)


def parse_configuration(text: str, *, source: str, folder: Path, check_files: bool = True) -> Configuration:
    """The configuration in a YAML text. `source` names it in messages, and its stem the run by default.

    Relative paths count from `folder`. Without `check_files` the files that it names need not exist,
    as when a finished run is read on another machine. Raises `GpsearchError` as `load_configuration`.
    """
    document = read_document(text, source)
    mistakes = list(document.mistakes)
    tree = {"name": _default_name(source), **document.tree}
    try:
        configuration = Configuration.model_validate(tree, context=Surroundings(folder, check_files))
    except ValidationError as error:
        mistakes += _validation_mistakes(error, document)
    if mistakes:
        raise GpsearchError(message(mistakes, source))
    return configuration


def _default_name(source: str) -> str:
    """The file's stem, with dashes in place of characters that a name cannot have."""
    return re.sub(r"[^A-Za-z0-9._-]+", "-", Path(source).stem)[:100].lstrip(".-") or "run"


def _validation_mistakes(error: ValidationError, document: Document) -> list[Mistake]:
    """The validator's errors, except in places that have a problem already."""
    refused = {mistake.place for mistake in document.mistakes}
    mistakes = []
    for number, details in enumerate(filter(_is_own, error.errors(include_url=False))):
        place = _place(details["loc"])
        if details["type"] != "extra_forbidden" and any(place[:end] in refused for end in range(len(place) + 1)):
            continue
        # The search for the nearest key takes long: only for what a message will list
        text = _text(details) if number < 2 * MOST else "is wrong"
        mistakes.append(Mistake(place, document.line(place), text))
    return mistakes


def _is_own(details: Any) -> bool:
    """Whether an error is not a consequence of others: a list whose items are refused counts as too short."""
    return details["type"] != "too_short" or not details["input"]


def _place(loc: Place) -> Place:
    """The place in the file: the validator's, without the kind of a section that has kinds."""
    return tuple(part for end, part in enumerate(loc) if not _is_kind(loc[: end + 1]))


def _is_kind(loc: Place) -> bool:
    keys = _keys(loc)
    return keys not in ALLOWED and (*keys, "kind") in ALLOWED


def _keys(loc: Place) -> Keys:
    return tuple(part for part in loc if isinstance(part, str))


def _text(details: Any) -> str:
    loc, kind = details["loc"], details["type"]
    if kind == "extra_forbidden":
        return _unknown_key(_keys(loc))
    if kind in ("value_error", "item"):
        return re.sub(r"^Value error, ", "", details["msg"])
    allowed = ALLOWED.get(_keys(loc)) or ALLOWED.get(_keys(loc)[:-1], "")
    if kind in ("missing", "union_tag_not_found"):
        return f"is missing; allowed: {allowed}"
    return f"found {shown(details['input'])}; allowed: {allowed}"


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
