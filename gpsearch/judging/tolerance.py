"""What a user allows a model to be off, as `psnr>=45 and flip<0.05`: parsed strictly."""

import math
import operator
import re
from collections.abc import Mapping
from dataclasses import dataclass

from fitters.judging.card import HIGHER_IS_BETTER, METRIC_NAMES
from fitters.judging.image_metrics import IMAGE_METRICS
from fitters.judging.table_metrics import TABLE_METRICS
from gpsearch.configuration.wording import listed, nearest
from gpsearch.errors import GpsearchError

_COMPARE = {">=": operator.ge, "<=": operator.le, ">": operator.gt, "<": operator.lt}
_LIMIT = re.compile(
    r"(?P<metric>[\w-]+?)\s*(?P<sign>[<>]=?)\s*(?P<bound>[+-]?[\d.]+(?:e[+-]?\d+)?)(?P<percent>\s*%)?", re.I
)
_DECIBELS = 20.0 / math.log(10.0)
"""Per unit of a natural logarithm of amplitudes."""

EXAMPLE = '"psnr>=45" or "psnr>=40 and delta-e-2000<1"'


@dataclass(frozen=True)
class Limit:
    """A bound of one metric, on the side where it is better."""

    metric: str
    sign: str
    bound: float

    def __str__(self) -> str:
        return f"{self.metric}{self.sign}{self.bound:g}{' dB' if _unit(self.metric) == 'dB' else ''}"

    def holds(self, value: float) -> bool:
        return bool(_COMPARE[self.sign](value, self.bound))

    def margin(self, value: float) -> float:
        """How far inside the bound a value lies, in the metric's unit; negative outside."""
        return value - self.bound if self.metric in HIGHER_IS_BETTER else self.bound - value

    def slack(self, value: float) -> float:
        """The same as the natural logarithm of a ratio of errors, as decibels are one: so metrics compare."""
        if self.metric in HIGHER_IS_BETTER:
            return (value - self.bound) / _DECIBELS
        return math.log(self.bound / value) if value > 0 else math.inf


@dataclass(frozen=True)
class Tolerance:
    """Limits that all have to hold, each of another metric."""

    limits: tuple[Limit, ...]

    def __str__(self) -> str:
        return " and ".join(map(str, self.limits))

    @property
    def metrics(self) -> tuple[str, ...]:
        return tuple(limit.metric for limit in self.limits)

    def holds(self, values: Mapping[str, float]) -> bool:
        """Whether values by metric, others among them, are all within."""
        return all(limit.holds(values[limit.metric]) for limit in self.limits)

    def slack(self, values: Mapping[str, float]) -> float:
        """The least slack of a limit: the larger, the better; negative where a limit is broken."""
        return min(limit.slack(values[limit.metric]) for limit in self.limits)


def parse_tolerance(text: str) -> Tolerance:
    """The tolerance of a text. Raises `GpsearchError` that says which part is wrong, and how to write it."""
    limits = tuple(_limit(part.strip()) for part in re.split(r"\band\b", text, flags=re.IGNORECASE))
    names = [limit.metric for limit in limits]
    for name in names:
        if names.count(name) > 1:
            raise GpsearchError(f"tolerance: {name} is limited twice; keep the stricter one")
    return Tolerance(limits)


def _limit(part: str) -> Limit:
    match = _LIMIT.fullmatch(part)
    name = (match["metric"] if match else re.match(r"[\w-]*", part)[0]).lower()  # type: ignore[index]
    if name and name not in METRIC_NAMES:
        hint = nearest(name, METRIC_NAMES)
        raise GpsearchError(
            f"tolerance: there is no metric {name!r}: "
            + (f"did you mean {hint}?" if hint else f"there are {listed(METRIC_NAMES)}")
        )
    bound = _number(match["bound"]) if match else None
    if match is None or bound is None:
        raise GpsearchError(
            f"tolerance: {part!r} is no limit: write a metric, one of >= > <= <, and a number, as in {EXAMPLE}"
        )
    if match["percent"]:
        if _unit(name):
            raise GpsearchError(f"tolerance: {part!r}: {name} is in {_unit(name)}, not a share; leave out the %")
        bound /= 100.0
    return _checked(Limit(name, match["sign"], bound), part)


def _checked(limit: Limit, part: str) -> Limit:
    higher = limit.metric in HIGHER_IS_BETTER
    if higher != limit.sign.startswith(">"):
        better, sign = ("more", ">=") if higher else ("less", "<=")
        raise GpsearchError(
            f"tolerance: {part!r} allows what is bad and refuses what is good: of {limit.metric}, {better} is "
            f"better; write {limit.metric}{sign}{limit.bound:g}"
        )
    if not higher and limit.bound <= 0:
        raise GpsearchError(f"tolerance: {part!r}: no model has so little {limit.metric}; give a number above 0")
    return limit


def _number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _unit(metric: str) -> str:
    return IMAGE_METRICS[metric].unit if metric in IMAGE_METRICS else TABLE_METRICS[metric].unit
