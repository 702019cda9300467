"""What a user allows a model to be off, as `psnr>=45 and flip<0.05`: parsed strictly."""

import math
import operator
import re
from collections.abc import Mapping
from dataclasses import dataclass

from fitters.judging.metrics import CARD_METRICS
from gpsearch.configuration.wording import listed, nearest
from gpsearch.errors import GpsearchError

_COMPARE = {">=": operator.ge, "<=": operator.le, ">": operator.gt, "<": operator.lt}
_LIMIT = re.compile(
    r"(?P<metric>[\w-]+?)\s*(?P<sign>[<>]=?)\s*(?P<bound>[+-]?[\d.]+(?:e[+-]?\d+)?)(?P<percent>\s*%)?", re.I
)

EXAMPLE = '"psnr>=45" or "psnr>=40 and delta-e-2000<1"'


@dataclass(frozen=True)
class Limit:
    """A bound of one metric, on the side where it is better."""

    metric: str
    sign: str
    bound: float

    def __str__(self) -> str:
        return f"{self.metric}{self.sign}{self.bound:g}{' dB' if CARD_METRICS[self.metric].unit == 'dB' else ''}"

    def holds(self, value: float) -> bool:
        return bool(_COMPARE[self.sign](value, self.bound))

    def margin(self, value: float) -> float:
        """How far inside the bound a value lies, in the metric's unit; negative outside."""
        return CARD_METRICS[self.metric].margin(self.bound, value)

    def slack(self, value: float) -> float:
        """The same as the natural logarithm of a ratio of errors, in which different metrics can be compared."""
        return CARD_METRICS[self.metric].slack(self.bound, value)


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
    if name and name not in CARD_METRICS:
        hint = nearest(name, CARD_METRICS)
        raise GpsearchError(
            f"tolerance: there is no metric {name!r}: "
            + (f"did you mean {hint}?" if hint else f"there are {listed(CARD_METRICS)}")
        )
    bound = _number(match["bound"]) if match else None
    if match is None or bound is None:
        raise GpsearchError(
            f"tolerance: {part!r} is no limit: write a metric, one of >= > <= <, and a number, as in {EXAMPLE}"
        )
    if match["percent"]:
        if unit := CARD_METRICS[name].unit:
            raise GpsearchError(f"tolerance: {part!r}: {name} is in {unit}, not a share; leave out the %")
        bound /= 100.0
    return _checked(Limit(name, match["sign"], bound), part)


def _checked(limit: Limit, part: str) -> Limit:
    higher = CARD_METRICS[limit.metric].higher_is_better
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
