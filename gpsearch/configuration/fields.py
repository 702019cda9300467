"""Fields of the configuration model that say what they allow, in words that an error message can quote."""

import math
import re
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError, ValidationError

from gpsearch.configuration.wording import listed, nearest, shown

LARGEST = 2**63 - 1
"""What SQLite stores in an integer column."""

_EXPONENT = re.compile(r"[-+]?[0-9]+(\.[0-9]*)?[eE][-+]?[0-9]{1,3}")


class Surroundings(NamedTuple):
    """What relative paths count from, and whether the files they name are looked for."""

    folder: Path
    check_files: bool


class Section(BaseModel):
    """A mapping of known keys. One that is there but empty, all its lines commented out, holds its defaults."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)

    @model_validator(mode="before")
    @classmethod
    def _empty(cls, value: Any) -> Any:
        return {} if value is None else value


SomeSection = TypeVar("SomeSection", bound=Section)


def section(kind: type[SomeSection]) -> Any:
    return Field(default_factory=kind, description=f"a mapping of the keys {listed(kind.model_fields)}")


def _number(value: Any) -> Any:
    """Refuses `true`, which Python counts as 1, and reads `1e-6`, which YAML 1.1 takes for a text."""
    if isinstance(value, bool):
        raise PydanticCustomError("number", "not a number")
    if isinstance(value, str) and _EXPONENT.fullmatch(value):
        return float(value)
    return value


Whole = Annotated[int, BeforeValidator(_number)]
Number = Annotated[float, BeforeValidator(_number), Field(allow_inf_nan=False)]


def whole(default: int | None, low: int, high: int = LARGEST, *, nullable: bool = False) -> Any:
    """A field for a whole number in [low, high]."""
    span = f"{low} to {high}" if high < LARGEST else f"{low} up"
    words = f"a whole number from {span}{', or null' if nullable else ''}"
    return Field(default, ge=low, le=high, description=words)


def number(
    default: float | None, *, low: float = -math.inf, above: float | None = None, nullable: bool = False
) -> Any:
    """A field for a finite number of at least `low`, or greater than `above`."""
    words = "a finite number"
    if above is not None:
        words += f" greater than {above:g}"
    elif math.isfinite(low):
        words += f" of at least {low:g}"
    words += ", or null" if nullable else ""
    return Field(default, ge=low, gt=above, description=words)


def one_of(names: Collection[str]) -> Callable[[str], str]:
    """A validator of names, which suggests the nearest one."""

    def check(name: str) -> str:
        if name not in names:
            near = nearest(name, names)
            hint = f"did you mean {near}? " if near else ""
            raise ValueError(f"found {shown(name)}; {hint}allowed: {listed(names)}")
        return name

    return check


def refuse_at(index: int, value: Any, text: str) -> ValidationError:
    """The error of one item of a list, from a validator of the whole list."""
    # Braces would be read as a template's
    reason = PydanticCustomError("item", "{text}", {"text": text})
    return ValidationError.from_exception_data("list", [InitErrorDetails(type=reason, loc=(index,), input=value)])
