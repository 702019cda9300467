"""What the printed and the interactive chart have in common."""

from typing import NamedTuple

from fitters.fitting import RESIDUALS
from gpsearch.pictures.chart.models import AXES, Chart, Charted


class Spot(NamedTuple):
    """Where a model is drawn, and beyond which edge it lies: `left`, `bottom`, `top`, or an empty string."""

    x: float
    y: float
    edge: str


class Frame:
    """Where the models of a chart are drawn: what a logarithmic axis has no room for lies on an edge.

    `bottom` and `top` are the limits of the error. A relative error above 1 is more than a black material has:
    such a model is on the upper edge, one without an error on the lower.
    """

    def __init__(self, chart: Chart) -> None:
        errors = [e for model in chart.fitted for e in (model.error, model.entry.test_error) if e]
        within = [error for error in errors if error <= 1 or not RESIDUALS[chart.run.metric].normalised] or errors
        self.bottom = min(within, default=1.0) / 1.35
        self.top = max(within, default=1.0) * 1.2
        self._left = {axis.key: _half_of_least(chart, axis.key) for axis in AXES}

    def spot(self, model: Charted, key: str) -> Spot:
        """Of a model that has an error and this cost."""
        return self._at(model, key, model.error or 0.0)

    def test_spot(self, model: Charted, key: str) -> Spot | None:
        """Where its error on test materials is drawn; None where there is none, or in the place of the other."""
        if model.entry.test_error is None:
            return None
        spot = self._at(model, key, model.entry.test_error)
        return None if spot == self.spot(model, key) else spot

    def _at(self, model: Charted, key: str, error: float) -> Spot:
        cost = model.cost(key)
        x = cost or self._left[key]
        if error < self.bottom:
            return Spot(x, self.bottom, "bottom")
        if error > self.top:
            return Spot(x, self.top, "top")
        return Spot(x, error, "" if cost else "left")

    def steps(self, chart: Chart, key: str) -> list[tuple[float, float]]:
        """(cost, error) of the models that no other beats there, as far as they are inside, from the left."""
        unbeaten = [model for model in chart.fitted if key in model.unbeaten]
        spots = [self.spot(model, key) for model in unbeaten]
        return sorted((spot.x, spot.y) for spot in spots if spot.edge in ("", "left"))


def _half_of_least(chart: Chart, key: str) -> float:
    """Where a cost of 0 is drawn."""
    return min((cost for model in chart.fitted if (cost := model.cost(key))), default=1.0) / 2


def digits(low: float, high: float) -> str:
    """Leading digits of the numbers that a logarithmic axis shows: as many as there is room for."""
    return "1" if high / low > 1e3 else "125" if high / low > 20 else "1235" if high / low > 5 else "123456789"


def title(chart: Chart) -> str:
    count, tests = len(chart.run.materials), len(chart.run.test_materials)
    tested = f", tested on {tests} other{'s' if tests > 1 else ''}" if tests else ""
    return f"{chart.run.name}: error against cost, {count} material{'s' if count > 1 else ''}{tested}"


def edge_remark(model: Charted, spot: Spot) -> str:
    """The error, beside the name of a model that is not drawn where it is."""
    return f": {model.error:.2g}" if spot.edge in ("bottom", "top") else ""
