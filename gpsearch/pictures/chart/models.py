"""What a chart shows: models with their error and their costs, and which of them no other beats."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from fitters.judging.timing import Timing
from gpsearch.judging.contenders import Contender
from gpsearch.run import Baseline, FoundFormula, RunInformation, non_dominated
from gpsearch.run.result import FitOnTests

MEASURED = "measured"
"""Name and kind of the table that all others are fitted to."""


class Axis(NamedTuple):
    """A cost that the error is charted against: its key for `Charted.cost`, and what it is."""

    key: str
    label: str


AXES = (
    Axis("ns", "time of an evaluation (ns)"),
    Axis("fit_seconds", "time of the fit to all materials (s)"),
    Axis("nodes", "size of the formula (nodes)"),
    Axis("floats", "numbers stored a material"),
)

TOGETHER = ("ns", "floats")
"""A model that no other beats in the error and all of these at once has a mark of its own."""


@dataclass(frozen=True)
class Charted:
    """A model of the chart: its entry, and what was measured of it here. What it does not have is None.

    timing, coherent:  of an evaluation of all three channels at incoherent and at coherent directions
    unbeaten:          axes on which no other model has both a smaller error and a smaller cost
    unbeaten_together: whether no other beats it in the error and `TOGETHER`
    """

    entry: FoundFormula | Baseline
    fit_seconds: float | None
    timing: Timing | None
    coherent: Timing | None
    unbeaten: frozenset[str] = frozenset()
    unbeaten_together: bool = False

    @property
    def title(self) -> str:
        return "measured table" if self.entry.kind == MEASURED else self.entry.title

    @property
    def error(self) -> float | None:
        return self.entry.error

    def cost(self, key: str) -> float | None:
        """On an axis; None where it has no such cost."""
        costs: dict[str, float | None] = {
            "ns": self.timing.ns if self.timing else None,
            "fit_seconds": self.fit_seconds,
            "nodes": self.entry.nodes,
            "floats": self.entry.floats,
        }
        return costs[key]


@dataclass(frozen=True)
class Chart:
    """Models in the order of a result, the measured table last, and what the loop alone takes (ns)."""

    run: RunInformation
    empty: Timing
    models: tuple[Charted, ...]

    @property
    def fitted(self) -> tuple[Charted, ...]:
        """Those that have an error."""
        return tuple(model for model in self.models if model.error is not None)

    @property
    def unfitted(self) -> tuple[Charted, ...]:
        return tuple(model for model in self.models if model.error is None)


def chart_of(
    run: RunInformation,
    contenders: Sequence[Contender],
    fit_seconds: Mapping[str, float],
    incoherent: Mapping[str, Timing],
    coherent: Mapping[str, Timing],
    empty: Timing,
    measured_floats: int,
) -> Chart:
    """The chart of contenders. Mappings are by the entry's name; `MEASURED` is the measured table's."""
    entries = [*(one.entry for one in contenders), _measured_table(run, measured_floats)]
    models = []
    for entry in entries:
        seconds = None if entry.kind == MEASURED else fit_seconds.get(entry.name, entry.fit_seconds)
        models.append(Charted(entry, seconds, incoherent.get(entry.name), coherent.get(entry.name)))
    return Chart(run, empty, tuple(marked(models)))


def _measured_table(run: RunInformation, floats: int) -> Baseline:
    """The measurement as an entry: without an error on any material."""
    test = FitOnTests(error=0.0, errors={}, metrics={}, warnings=()) if run.test_materials else None
    return Baseline(
        name=MEASURED,
        kind=MEASURED,
        floats=floats,
        error=0.0,
        errors={},
        metrics={},
        cost_ns=0.0,
        warnings=(),
        fit_seconds=0.0,
        test=test,
    )


def marked(models: Sequence[Charted]) -> list[Charted]:
    """The models, with what no other beats; one that lacks a cost does not compete in it."""
    on_axis = {axis.key: _unbeaten(models, (axis.key,)) for axis in AXES}
    together = _unbeaten(models, TOGETHER)
    return [
        replace(
            model,
            unbeaten=frozenset(key for key, names in on_axis.items() if model.entry.name in names),
            unbeaten_together=model.entry.name in together,
        )
        for model in models
    ]


def _unbeaten(models: Sequence[Charted], keys: Sequence[str]) -> set[str]:
    """Names of the models that no other beats in the error and these costs."""
    rows: list[tuple[str, Any]] = [(m.entry.name, (m.error, *map(m.cost, keys))) for m in models]
    whole = [(name, costs) for name, costs in rows if None not in costs]
    return {name for name, _ in non_dominated(whole, lambda row: row[1], keep_equals=True)}
