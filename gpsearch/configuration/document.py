"""A YAML text as plain mappings, lists and scalars, with the line of each.

Stricter than PyYAML's safe loader: it refuses aliases (a few lines of them expand to gigabytes), tags, repeated
keys, and numbers that YAML 1.1 reads in another base.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import yaml
from yaml.composer import ComposerError
from yaml.reader import ReaderError

from gpsearch.configuration.wording import Mistake, Place, plain, shown
from gpsearch.errors import GpsearchError

MAX_DEPTH = 20
MAX_VALUES = 10_000
"""Keys, items and scalars: reading a megabyte of them would take minutes."""

_TAG = "tag:yaml.org,2002:"
_DECIMAL = re.compile(r"[-+]?(0|[1-9][0-9_]*)|[-+]?[0-9_]*\.[^:]*")


@dataclass(frozen=True)
class Document:
    """`tree` holds the values without mistakes, `lines` the line, from 1, of every key and item."""

    tree: dict[str, Any]
    lines: Mapping[Place, int]
    mistakes: tuple[Mistake, ...]

    def line(self, place: Place) -> int:
        """The line of a place; where the file does not have it, the line of what encloses it."""
        while place and place not in self.lines:
            place = place[:-1]
        return self.lines.get(place, 1)


def read_document(text: str, source: str) -> Document:
    """The document in a YAML text. Raises `GpsearchError`, naming `source` and line, for other text."""
    try:
        loader = _Loader(text)
        root = loader.get_single_node()
    except ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        raise GpsearchError(
            f"{source}:{line}: character U+{int(error.character):04X} has no place in YAML; remove it"
        ) from None
    except yaml.MarkedYAMLError as error:
        raise GpsearchError(f"{source}:{_syntax(error)}") from None
    except (ValueError, OverflowError) as error:
        # Of an escape or a version that is out of range: PyYAML does not turn these into its own errors
        raise GpsearchError(
            f"{source}: not valid YAML ({error}); look for an escape such as \\UFFFFFFFF"
        ) from None
    if root is None:
        raise GpsearchError(f"{source}: the file is empty; it needs `materials:` at least")
    if not isinstance(root, yaml.MappingNode):
        kind = "a list" if isinstance(root, yaml.SequenceNode) else shown(root.value)
        line = root.start_mark.line + 1
        raise GpsearchError(f"{source}:{line}: found {kind}; a configuration consists of lines `key: value`")
    walk = _Walk(loader)
    tree = walk.value(root, ())
    return Document(tree, walk.lines, tuple(walk.mistakes))


class _Loader(yaml.SafeLoader):
    """Composes nodes. Refuses aliases, tags, deep nesting and too many values before it reads on."""

    depth = 0
    values = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        event = self.peek_event()
        if isinstance(event, yaml.AliasEvent):
            self.refuse(f"the alias *{event.anchor} is refused; write the value out", event)
        if getattr(event, "tag", None) is not None:
            self.refuse("a tag (! or !!) is refused; write a plain value, or quote a text with !", event)
        if self.depth == MAX_DEPTH:
            self.refuse(f"nested more than {MAX_DEPTH} levels deep", event)
        if self.values == MAX_VALUES:
            self.refuse(f"more than {MAX_VALUES:,} keys and values; is it a configuration?", event)
        self.depth += 1
        self.values += 1
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node

    def refuse(self, text: str, event: Any) -> None:
        raise ComposerError(None, None, text, event.start_mark)


class _Walk:
    """Turns nodes into values, records lines and collects mistakes."""

    def __init__(self, loader: _Loader) -> None:
        self.loader = loader
        self.lines: dict[Place, int] = {}
        self.mistakes: list[Mistake] = []

    def value(self, node: yaml.Node, place: Place) -> Any:
        if isinstance(node, yaml.MappingNode):
            return self.mapping(node, place)
        if isinstance(node, yaml.SequenceNode):
            return [self.item(item, (*place, index)) for index, item in enumerate(node.value)]
        return self.scalar(node, place)

    def item(self, node: yaml.Node, place: Place) -> Any:
        self.lines[place] = node.start_mark.line + 1
        return self.value(node, place)

    def mapping(self, node: yaml.MappingNode, place: Place) -> dict[str, Any]:
        mapping: dict[str, Any] = {}
        for key_node, value_node in node.value:
            key, line = self.key(key_node), key_node.start_mark.line + 1
            if key is None:
                text = "a key is a text; quote it if it is meant to be one"
                self.mistakes.append(Mistake((*place, shown(key_node.value)), line, text))
            elif key in mapping:
                first = self.lines[(*place, key)]
                text = f"the key is there already, in line {first}; keep one of them"
                self.mistakes.append(Mistake((*place, key), line, text))
            else:
                self.lines[(*place, key)] = line
                mapping[key] = self.value(value_node, (*place, key))
        return mapping

    def key(self, node: yaml.Node) -> str | None:
        is_text = isinstance(node, yaml.ScalarNode) and node.tag == _TAG + "str" and _encodes(node.value)
        return node.value if is_text else None

    def scalar(self, node: yaml.Node, place: Place) -> Any:
        """The value of a scalar. A date stays a text: no key of a configuration takes a date."""
        kind = node.tag.removeprefix(_TAG)
        if kind not in ("int", "float", "bool", "null"):
            return node.value if _encodes(node.value) else self.refuse(node, place, "holds half a character")
        if kind in ("int", "float") and not _DECIMAL.fullmatch(node.value):
            return self.refuse(node, place, "is read in another base; write it in decimals, or quote a text")
        try:
            return self.loader.construct_object(node)
        except ValueError:
            return self.refuse(node, place, "has too many digits")

    def refuse(self, node: yaml.Node, place: Place, text: str) -> None:
        line = node.start_mark.line + 1
        self.mistakes.append(Mistake(place, line, f"{shown(node.value)} {text}"))


def _encodes(text: str) -> bool:
    """Whether a text is free of lone surrogates, such as the escape \\ud800."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def _syntax(error: yaml.MarkedYAMLError) -> str:
    """Line, column and meaning of a syntax error."""
    mark = error.problem_mark or error.context_mark
    where = f"{mark.line + 1}: column {mark.column + 1}: " if mark else " "
    what = " ".join(part for part in (error.problem, error.context) if part)
    advice = "; indent with spaces, not tabs" if "'\\t'" in what else ""
    return where + plain(what) + advice
