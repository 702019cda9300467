"""Running a function over one item, whatever it raises."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from fitters.errors import FittersError

RAISES = 3
"""An item is given up after so many exceptions."""


@dataclass(frozen=True)
class Raised:
    """In place of the result of an item whose function raised."""

    text: str


def attempt(function: Callable[[Any, Any], Any], context: Any, item: Any) -> Any:
    """The function's result, or `Raised`. Bad input is not the item's fault: `FittersError` goes through."""
    try:
        return function(context, item)
    except FittersError:
        raise
    except Exception as error:
        return Raised(f"{type(error).__name__}: {error}")
