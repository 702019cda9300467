"""What every metric is: a name, what it is measured on, how it is read, and a number for a model of a material."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Literal

import numpy as np

from fitters.errors import FittersError
from fitters.grid import SHAPE, Array
from fitters.materials import Material
from fitters.rendering import Picture
from fitters.scenes import LightTable

MeasuredOn = Literal["light table", "table", "image", "samples"]
"""`light table`: the cells that a scene lights, weighted by it; `table`: all valid cells; `image`: a rendered
picture; `samples`: the samples of an anisotropic measurement, which no scene lights."""

PerChannel = tuple[float, float, float]

DECIBELS = 20.0 / math.log(10.0)
"""Per unit of a natural logarithm of amplitudes."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """The value of a metric; of an image also its errors (h, w), where larger is worse, 0 in the background."""

    value: float
    per_pixel: Array | None = None


@dataclass(frozen=True, eq=False)
class Compared:
    """A measured material and a model of it in a scene.

    values:  (3, 90, 90, 180) the model in sr^-1; what it is in cells that are not valid does not count
    truth:   the picture of the measurement, and `picture` that of the model; None where no image metric is asked

    Raises `FittersError` for values of another shape.
    """

    material: Material
    light: LightTable
    values: Array
    truth: Picture | None = None
    picture: Picture | None = None

    def __post_init__(self) -> None:
        if self.values.shape != (3, *SHAPE):
            raise FittersError(
                f"{self.material.name}: a model's values are (3, 90, 90, 180), not {self.values.shape}"
            )


@dataclass(frozen=True)
class Metric(ABC):
    """A distance (or likeness) of a model and a measurement.

    unit:      empty for a share, which may be written in per cent
    better:    which values are the better ones
    protocol:  how it is computed, in words
    label:     its name in charts and headings; `name` where empty
    short:     its name above a column of ten characters; `name` where empty
    on_cards:  whether accuracy cards show it
    symmetric: whether measurement and model may change places; where they may not, the protocol says why
    """

    name: str
    measured_on: MeasuredOn
    protocol: str
    _: KW_ONLY
    unit: str = ""
    better: Literal["lower", "higher"] = "lower"
    label: str = ""
    short: str = ""
    on_cards: bool = True
    symmetric: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "label", self.label or self.name)
        object.__setattr__(self, "short", self.short or self.name)

    @abstractmethod
    def measure(self, compared: Compared) -> Comparison:
        """The metric of a model.

        Raises `FittersError` where `compared` has no pictures for an image metric, or is black.
        """

    @property
    def higher_is_better(self) -> bool:
        return self.better == "higher"

    @property
    def best(self) -> float:
        """The value of a model that equals the measurement."""
        return math.inf if self.higher_is_better else 0.0

    def describe(self) -> dict[str, str]:
        """Unit, direction and protocol, as reports have them."""
        return {"unit": self.unit, "better": self.better, "protocol": self.protocol}

    def margin(self, bound: float, value: float) -> float:
        """How far a value is on the better side of a bound, in the metric's unit; negative on the other side."""
        return value - bound if self.higher_is_better else bound - value

    def slack(self, bound: float, value: float) -> float:
        """The margin as the natural logarithm of a ratio of errors, in which different metrics can be compared."""
        if self.unit == "dB":
            return self.margin(bound, value) / DECIBELS
        better, worse = (value, bound) if self.higher_is_better else (bound, value)
        return math.log(better / worse) if worse > 0 else math.inf


def registered(*families: Sequence[Metric]) -> Mapping[str, Metric]:
    """Metrics by name. Raises `FittersError` where two have the same one."""
    metrics = [metric for family in families for metric in family]
    by_name = {metric.name: metric for metric in metrics}
    if len(by_name) < len(metrics):
        names = [metric.name for metric in metrics]
        twice = sorted({name for name in names if names.count(name) > 1})
        raise FittersError(f"metrics: two are called {', '.join(twice)}; give each a name of its own")
    return by_name


def over_channels(errors: PerChannel) -> Comparison:
    """The root mean square of the errors of three channels."""
    return Comparison(float(np.sqrt(np.mean(np.square(errors)))))
