"""What a chart shows: models with their error and their costs, and which of them no other beats."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from fitters.judging.timing import Timing
from gpsearch.judging import Contender
from gpsearch.pictures.chart.dominance import non_dominated

MEASURED = "measured"
"""The kind of the table that all others are fitted to."""


class Axis(NamedTuple):
    """A cost that the error is charted against: an attribute of `Charted`, and what it is."""

    key: str
    label: str


AXES = (
    Axis("ns", "time of an evaluation (ns)"),
    Axis("fit_seconds", "time of the fit to all materials (s)"),
    Axis("nodes", "size of the formula (nodes)"),
    Axis("floats", "numbers stored a material"),
)

TOGETHER = ("error", "ns", "floats")
"""A model that no other beats in all of these at once has a mark of its own."""


@dataclass(frozen=True)
class Charted:
    """A model of the chart. What it does not have is None: a table has no nodes, what was not fitted no error.

    title:           its name as charts show it
    test_error:      on materials that the search was not on, where the run has any
    ns, ns_coherent: of an evaluation of all three channels at incoherent and at coherent directions
    unbeaten:        axes on which no other model has both a smaller error and a smaller cost
    unbeaten_together: whether no other beats it in `TOGETHER`
    """

    title: str
    name: str
    kind: str
    expression: str | None
    nodes: int | None
    floats: int
    error: float | None
    fit_seconds: float | None
    timing: Timing | None
    coherent: Timing | None
    warnings: tuple[str, ...] = ()
    test_error: float | None = None
    unbeaten: frozenset[str] = field(default=frozenset())
    unbeaten_together: bool = False

    @property
    def ns(self) -> float | None:
        return self.timing.ns if self.timing else None

    @property
    def ns_coherent(self) -> float | None:
        return self.coherent.ns if self.coherent else None

    def costs(self, keys: Sequence[str]) -> list[float] | None:
        """Its values of some attributes; None where it lacks one."""
        found = [getattr(self, key) for key in keys]
        return None if None in found else [float(value) for value in found]


@dataclass(frozen=True)
class Chart:
    """Models in the order of a run's export, the measured table last, and what the loop alone takes (ns).

    tests: names of the test materials
    """

    run: str
    metric: str
    materials: tuple[str, ...]
    empty: Timing
    models: tuple[Charted, ...]
    tests: tuple[str, ...] = ()

    @property
    def fitted(self) -> tuple[Charted, ...]:
        """Those that have an error."""
        return tuple(model for model in self.models if model.error is not None)

    @property
    def unfitted(self) -> tuple[Charted, ...]:
        return tuple(model for model in self.models if model.error is None)


def chart_of(
    run: Mapping,
    contenders: Sequence[Contender],
    fit_seconds: Mapping[str, float],
    incoherent: Mapping[str, Timing],
    coherent: Mapping[str, Timing],
    empty: Timing,
    measured_floats: int,
) -> Chart:
    """The chart of an export's `run`. Mappings are by contender's name; `MEASURED` is the measured table's."""
    tests = tuple(run.get("test_materials", ()))
    models = [
        Charted(
            title=one.title,
            name=one.name,
            kind=one.kind,
            expression=one.expression,
            nodes=one.nodes,
            floats=one.floats,
            error=one.error,
            fit_seconds=fit_seconds.get(one.name, one.fit_seconds),
            timing=incoherent.get(one.name),
            coherent=coherent.get(one.name),
            warnings=one.warnings,
            test_error=one.test_error,
        )
        for one in contenders
    ]
    models.append(
        Charted(
            title="measured table",
            name=MEASURED,
            kind=MEASURED,
            expression=None,
            nodes=None,
            floats=measured_floats,
            error=0.0,
            fit_seconds=None,
            timing=incoherent[MEASURED],
            coherent=coherent[MEASURED],
            test_error=0.0 if tests else None,
        )
    )
    return Chart(run["name"], run["metric"], tuple(run["materials"]), empty, tuple(marked(models)), tests)


def marked(models: Sequence[Charted]) -> list[Charted]:
    """The models, with what no other beats; one that lacks a cost does not compete in it."""
    on_axis = {axis.key: _free(models, ("error", axis.key)) for axis in AXES}
    together = _free(models, TOGETHER)
    return [
        replace(
            model,
            unbeaten=frozenset(key for key, names in on_axis.items() if model.name in names),
            unbeaten_together=model.name in together,
        )
        for model in models
    ]


def _free(models: Sequence[Charted], keys: Sequence[str]) -> set[str]:
    """Names of the models that no other beats in these attributes."""
    costs = {model.name: found for model in models if (found := model.costs(keys)) is not None}
    return {name for name, free in zip(costs, non_dominated(list(costs.values())), strict=True) if free}
