"""What a hazard is: a name, its levels from mild to hard, and a pure function of base, level and seed."""

from collections.abc import Callable
from dataclasses import dataclass

from fitters.stability.case import Base, Case


@dataclass(frozen=True)
class Hazard:
    """`make(base, level, seed)` is the case.

    levels:     what the severity is called, from mild to hard
    make:       of a base, a level's place among `levels`, and a seed
    random:     whether the seed changes the case
    any_base:   whether it can be made of any material, or needs a formula of its own
    """

    name: str
    meaning: str
    levels: tuple[str, ...]
    make: Callable[[Base, int, int], Case]
    random: bool = False
    any_base: bool = True
