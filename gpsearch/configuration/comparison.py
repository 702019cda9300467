"""How two configurations differ, and whether a run may go on under another one."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from gpsearch.configuration.wording import shown

FINDS_THE_SAME = frozenset({"executor", "test_materials"})
"""Keys of a configuration that do not change what is found."""


@dataclass(frozen=True)
class Difference:
    """A key that two configurations give different values; one that a configuration lacks is None."""

    key: str
    here: Any
    there: Any

    def __str__(self) -> str:
        return f"{self.key}: {shown(self.here)} instead of {shown(self.there)}"

    @property
    def extends(self) -> bool:
        """Whether a run with `there` may go on with `here`: a larger budget, work done elsewhere, other tests."""
        if self.key.split(".")[0] in FINDS_THE_SAME:
            return True
        if not self.key.startswith("budget."):
            return False
        return self.here is None or (self.there is not None and self.here > self.there)


def differences(here: Mapping[str, Any], there: Mapping[str, Any]) -> list[Difference]:
    """The differences of two configurations, given as nested mappings, in the order of their keys."""
    first, second = dict(_leaves(here)), dict(_leaves(there))
    keys = dict.fromkeys([*first, *second])
    pairs = ((key, first.get(key), second.get(key)) for key in keys)
    return [Difference(*pair) for pair in pairs if pair[1] != pair[2]]


def _leaves(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{prefix}{key}.")
        else:
            yield prefix + key, value
