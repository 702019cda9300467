"""From a run directory to its `Result`."""

import hashlib
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import TypeVar

from fitters import expressions
from fitters.expressions.catalogue import formula as published_formula
from fitters.fitting import RESIDUALS, Description
from fitters.fitting.culling import Culled
from fitters.models import Baseline as StoredBaseline
from fitters.models import FormulaBaseline
from gpsearch import __version__
from gpsearch.configuration import Configuration, parse_configuration
from gpsearch.configuration.materials import material_name
from gpsearch.run.front import Member, non_dominated
from gpsearch.run.identity import ProblemIdentity, stored_materials
from gpsearch.run.result import (
    Baseline,
    Channels,
    Culling,
    FitOnTests,
    FoundFormula,
    Metrics,
    Origin,
    Parameters,
    Result,
    RunInformation,
)
from gpsearch.run.store import Store
from gpsearch.run.transfers import Transfer, combined

T = TypeVar("T")
FitsOnTests = Callable[[str, Iterable[str] | None], FitOnTests | None]
"""From a model's name in the store and a formula's parameters, None for what is no formula."""


def load_run(folder: Path | str) -> Result:
    """The result of a run directory, as far as it is described; also of a run that is searching.

    Raises `GpsearchError` where there is no run, or one of another version's.
    """
    store, configuration = open_run(Path(folder))
    with closing(store):
        return result_of(store, configuration)


def open_run(folder: Path) -> tuple[Store, Configuration]:
    """The store of a run directory, for reading, and its configuration. Raises `GpsearchError`."""
    store = Store.open(folder)
    return store, configuration_of(store)


def configuration_of(store: Store) -> Configuration:
    """The configuration that a run was made with; its files need not be there."""
    base = Path(store.meta("folder") or store.path.parent)
    return parse_configuration(store.configuration, source=str(store.path), folder=base, check_files=False)


def result_of(store: Store, configuration: Configuration) -> Result:
    """What a store holds. The formulas are those that are described, as culling has left them."""
    materials, metric = configuration.material_names, configuration.metric
    generations, candidates, _ = store.totals()
    transfers, baselines = store.transfers(), store.baselines()
    tests = dict(zip(configuration.test_material_names, configuration.test_materials, strict=True))

    def tested(model: str, symbols: Iterable[str] | None) -> FitOnTests | None:
        fits = {name: transfers.get((model, reference)) for name, reference in tests.items()}
        return fit_on_tests(fits, metric, symbols)

    distance, identity = store.meta("light_distance"), ProblemIdentity.of(store, configuration)
    run = RunInformation(
        name=configuration.name,
        seed=configuration.seed,
        version=__version__,
        config_sha256=configuration.sha256,
        materials=materials,
        test_materials=tuple(tests),
        scene=configuration.scene.recipe,
        light_distance=None if distance is None else float(distance),
        problem_sha256=identity.sha256 if identity else None,
        metric=metric,
        generations=generations,
        candidates=candidates,
        seconds=round(store.seconds, 3),
    )
    return Result(
        run=run,
        formulas=tuple(_formula(*one, materials, tested) for one in _listed(store)),
        baselines=tuple(
            baseline_entry(name, baselines[name], metric, materials, tested)
            for name in dict.fromkeys(configuration.baselines)
            if name in baselines
        ),
        configuration=configuration,
        hashes={material_name(reference): content for reference, content in stored_materials(store).items()},
        missing=len({member.expression for member in store.front().members} - store.descriptions().keys()),
    )


def listed_expressions(store: Store) -> list[str]:
    """The formulas of the result of a store, by size."""
    return [left.expression for _, _, left in _listed(store)]


def _listed(store: Store) -> list[tuple[Member, Description, Culled]]:
    """The members of the front that are described, each with its description and with what culling has left of it.

    Polishing and culling may have changed which of them is better than which.
    """
    described, culled = store.descriptions(), store.culled()
    rows = []
    for member in store.front().members:
        if (before := described.get(member.expression)) is not None:
            left = culled.get(member.expression)
            whole = Culled(member.expression, (), before)
            rows.append((member, before, whole if left is None or left.description is None else left))
    return non_dominated(rows, costs=_size_and_error, ties=lambda row: row[2].expression)


def _size_and_error(row: tuple[Member, Description, Culled]) -> tuple[float, float]:
    left = row[2]
    assert left.description is not None
    return expressions.parse(left.expression).nodes, left.description.fit.error


def _formula(
    member: Member, before: Description, left: Culled, materials: Sequence[str], tested: FitsOnTests
) -> FoundFormula:
    description = left.description
    assert description is not None
    fit, checks = description.fit, description.checks
    return FoundFormula(
        id=hashlib.sha256(left.expression.encode()).hexdigest()[:8],
        expression=left.expression,
        nodes=expressions.parse(left.expression).nodes,
        parameters=_parameters(description, materials),
        error=fit.error,
        errors=_by_material(fit.errors.tolist(), materials),
        metrics=finite(description.metrics),
        cost_ns=round(description.cost_ns, 3),
        start=member.genome.start,
        edits=member.genome.edits,
        origin=Origin(member.island, member.generation),
        checks=finite(vars(checks)),
        warnings=description.warnings,
        culled=Culling(member.expression, member.nodes, before.fit.error, left.steps) if left.steps else None,
        test=tested(left.expression, fit.names),
    )


def baseline_entry(
    name: str,
    baseline: StoredBaseline,
    metric: str,
    materials: Sequence[str],
    tested: FitsOnTests = lambda model, symbols: None,
) -> Baseline:
    """A baseline that a run by `metric` has stored, of its materials."""
    if isinstance(baseline, FormulaBaseline):
        description, published = baseline.description, published_formula(name).expression
        fit = description.fit
        return Baseline(
            name=name,
            kind="formula",
            expression=expressions.to_text(published),
            nodes=published.nodes,
            floats=3 * len(fit.names),
            parameters=_parameters(description, materials),
            error=finite_or_none(fit.error),
            errors=_by_material(fit.errors.tolist(), materials),
            metrics=finite(description.metrics),
            cost_ns=round(description.cost_ns, 3),
            warnings=description.warnings,
            fit_seconds=round(baseline.fit_seconds, 3),
            test=tested(name, fit.names),
        )
    metrics = finite(baseline.metrics)
    return Baseline(
        name=name,
        kind=baseline.kind,
        floats=baseline.floats,
        error=metrics[metric],
        errors=_by_material(baseline.errors[metric], materials),
        metrics=metrics,
        cost_ns=round(baseline.cost_ns, 3),
        warnings=baseline.warnings,
        fit_seconds=round(baseline.fit_seconds, 3),
        test=tested(name, None),
    )


def fit_on_tests(
    fits: Mapping[str, Transfer | None], metric: str, symbols: Iterable[str] | None
) -> FitOnTests | None:
    """The fits to test materials, by name, as one; None without materials.

    `symbols` are the parameters of a formula, None for what is no formula. A fit that is None is not there yet:
    then the error over all materials is None, as it is where a fit is not finite.
    """
    if not fits:
        return None
    there = {name: fit for name, fit in fits.items() if fit is not None}
    metrics = combined(list(there.values())) if len(there) == len(fits) else dict.fromkeys(RESIDUALS, math.inf)
    return FitOnTests(
        error=finite_or_none(metrics[metric]),
        errors={name: _channels(fit.errors) if fit else (None, None, None) for name, fit in fits.items()},
        metrics=finite(metrics),
        warnings=tuple(warning for fit in there.values() for warning in fit.warnings),
        parameters=None
        if symbols is None
        else {
            symbol: {
                name: _channels(fit.parameters[symbol])
                for name, fit in there.items()
                if all(map(math.isfinite, fit.errors))
            }
            for symbol in symbols
        },
    )


def _parameters(description: Description, materials: Sequence[str]) -> Parameters:
    columns = description.fit.columns
    return {name: _by_material(values.tolist(), materials) for name, values in columns.items()}


def _by_material(values: Sequence[float], materials: Sequence[str]) -> dict[str, Channels]:
    """Values of all targets by material."""
    return {name: _channels(values[3 * i : 3 * i + 3]) for i, name in enumerate(materials)}


def _channels(values: Sequence[float]) -> Channels:
    red, green, blue = map(finite_or_none, values)
    return red, green, blue


def finite(numbers: Mapping[str, float]) -> Metrics:
    """Numbers by name, None for what is not finite."""
    return {name: finite_or_none(value) for name, value in numbers.items()}


def finite_or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None
