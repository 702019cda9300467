"""The heavy data that a process keeps loaded, built by the process itself from a small recipe."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from threading import Lock
from typing import Any

KEPT = 2
"""How many contexts a process keeps: the one in use, and the one it used before."""


@dataclass(frozen=True)
class Recipe:
    """How a process gets its heavy data: `build(argument)`, called where the data is needed.

    A recipe travels with every task, so both parts are small and picklable: `build` is a function of a
    module, `argument` a value such as a frozen dataclass. Equal recipes give equal contexts.
    """

    build: Callable[[Any], Any]
    argument: Hashable


_contexts: OrderedDict[Recipe, Any] = OrderedDict()
_lock = Lock()


def context_of(recipe: Recipe) -> Any:
    """What `recipe` builds, from this process's memory where it is one of the last `KEPT` asked for.

    Threads that ask at once build once: the others wait. A build that raises is not remembered.
    """
    with _lock:
        if recipe not in _contexts:
            while len(_contexts) >= KEPT:
                _contexts.popitem(last=False)
            _contexts[recipe] = recipe.build(recipe.argument)
        _contexts.move_to_end(recipe)
        return _contexts[recipe]
