"""Which parameters of a formula are stored how often: a number per channel, per material, or for the whole set."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fitters.errors import FittersError
from fitters.grid import CHANNELS

Scope = Literal["channel", "material", "set"]

SCOPES: tuple[Scope, ...] = ("channel", "material", "set")
"""What a stored number is for, from most numbers to fewest."""


@dataclass(frozen=True)
class Sharing:
    """The scope of every parameter, in the order of `names`. Raises `FittersError` where they do not fit."""

    names: tuple[str, ...]
    scopes: tuple[Scope, ...]

    def __post_init__(self) -> None:
        if len(self.names) != len(self.scopes) or not set(self.scopes) <= set(SCOPES):
            raise FittersError(
                f"{', '.join(self.names) or 'no parameters'}: each has a scope, one of {', '.join(SCOPES)}; "
                f"given are {', '.join(self.scopes) or 'none'}"
            )

    @classmethod
    def nothing(cls, names: Sequence[str]) -> "Sharing":
        """Every parameter is free: a number per material and channel."""
        return cls(tuple(names), tuple(SCOPES[0] for _ in names))

    @property
    def floats(self) -> int:
        """Numbers that one material takes, with those of the whole set."""
        return sum(len(CHANNELS) if scope == "channel" else 1 for scope in self.scopes)

    def numbers(self, materials: int) -> int:
        """Numbers that a set of this number of materials takes."""
        stored = {"channel": len(CHANNELS) * materials, "material": materials, "set": 1}
        return sum(stored[scope] for scope in self.scopes)

    def tightened(self, materials: int) -> dict[str, "Sharing"]:
        """By name, the sharing in which that parameter goes a step further; a material alone is its whole set."""
        last = SCOPES.index("material" if materials == 1 else "set")
        options = {}
        for i, (name, scope) in enumerate(zip(self.names, self.scopes, strict=True)):
            at = SCOPES.index(scope)
            if at < last:
                options[name] = replace(self, scopes=(*self.scopes[:i], SCOPES[at + 1], *self.scopes[i + 1 :]))
        return options

    def slots(self, names: Sequence[str], targets: int) -> NDArray[np.int64]:
        """Which stored number is each target's value of each name, (targets, names), from 0 without gaps."""
        every = np.arange(targets)
        owner = {"channel": every, "material": every // len(CHANNELS), "set": np.zeros(targets, np.int64)}
        slots, first = np.empty((targets, len(names)), np.int64), 0
        for i, name in enumerate(names):
            of_name = owner[self.scopes[self.names.index(name)]]
            slots[:, i] = first + of_name
            first += int(of_name[-1]) + 1
        return slots
