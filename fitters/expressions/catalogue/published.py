"""What a catalogue entry is: a published BRDF with the meaning and the range of its parameters."""

from dataclasses import dataclass

from fitters.errors import FittersError
from fitters.expressions.expression import Expression


@dataclass(frozen=True)
class Parameter:
    """What a parameter means and the closed interval that a fit searches."""

    meaning: str
    low: float
    high: float


@dataclass(frozen=True)
class Formula:
    """A published BRDF: `parameters[i]` describes `p{i}`. Raises `FittersError` where the two disagree.

    year: in which `source` published the model; a term that came later, as its source says, does not count
    """

    name: str
    year: int
    source: str
    expression: Expression
    parameters: tuple[Parameter, ...]

    def __post_init__(self) -> None:
        described = tuple(f"p{i}" for i in range(len(self.parameters)))
        if self.expression.parameters != described:
            raise FittersError(f"{self.name} uses {self.expression.parameters}, but {described} are described")

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        return {f"p{i}": (p.low, p.high) for i, p in enumerate(self.parameters)}


Entry = tuple[str, int, str, str, tuple[Parameter, ...]]
"""Name, year, source, text form and parameters of a formula."""
