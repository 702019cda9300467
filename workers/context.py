"""What a process that works does: it keeps heavy data loaded, and tries a function on an item."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from threading import Lock
from typing import Any

from fitters.errors import FittersError

KEPT = 2
"""How many contexts a process keeps: the one in use, and the one it used before."""

RAISES = 3
"""How many exceptions an item may raise before it is given up."""


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


@dataclass(frozen=True)
class Raised:
    """In place of the result of an item whose function raised."""

    text: str


def attempt(function: Callable[[Any, Any], Any], context: Any, item: Any) -> Any:
    """The function's result, or `Raised`. Bad input is not the item's fault: `FittersError` is raised."""
    try:
        return function(context, item)
    except FittersError:
        raise
    except Exception as error:
        return Raised(f"{type(error).__name__}: {error}")
