"""Fields of the configuration: each has a description of its allowed values, which error messages quote."""

import math
import re
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError, ValidationError

from gpsearch.configuration.wording import listed, nearest, shown

LARGEST = 2**63 - 1
"""The largest integer that SQLite stores."""

_EXPONENT = re.compile(r"[-+]?[0-9]+(\.[0-9]*)?[eE][-+]?[0-9]{1,3}")


class Surroundings(NamedTuple):
    """The folder that relative paths count from, and whether the files must exist."""

    folder: Path
    check_files: bool


def surroundings(info: ValidationInfo) -> Surroundings:
    """By default, as for a configuration made by a program: the working folder, and files need not exist."""
    return info.context or Surroundings(Path.cwd(), check_files=False)


class Section(BaseModel):
    """A mapping of known keys. An empty one (null, all its lines commented out) holds its defaults."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)

    @model_validator(mode="before")
    @classmethod
    def _empty(cls, value: Any) -> Any:
        return {} if value is None else value


def section(kind: type[Section], *, nullable: bool = False) -> Any:
    """A field for a section, whose default is the section's defaults, or null."""
    words = f"a mapping of the keys {listed(kind.model_fields)}"
    return (
        Field(None, description=f"{words}, or null")
        if nullable
        else Field(default_factory=kind, description=words)
    )


def _number(value: Any) -> Any:
    """Refuses `true`, which Python counts as 1, and reads `1e-6`, which is a text in YAML 1.1."""
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
    # A template, because pydantic would read braces of the text as one
    reason = PydanticCustomError("item", "{text}", {"text": text})
    return ValidationError.from_exception_data("list", [InitErrorDetails(type=reason, loc=(index,), input=value)])
