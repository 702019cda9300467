"""Fits to the test materials, after a search: of all formulas and baselines that it lists."""

from collections.abc import Callable, Mapping
from typing import Any

from fitters.fitting import FitJob, transfer
from fitters.models import MODELS, MaterialTask, summarise
from gpsearch.configuration.materials import material_name
from gpsearch.run import Quarantined, Store, Transfer, WritableStore, listed_expressions
from gpsearch.search.plan import Plan
from workers import Failure, Job, Lane, Stopped


def transfer_lanes(plan: Plan, store: WritableStore) -> tuple[int, list[Lane]]:
    """Lanes of the missing fits to test materials, and the number of these fits.

    The lanes of one material follow each other, so that a process loads one material after the other and
    holds only one of them at a time.
    """
    count, lanes = 0, []
    for reference, (jobs, names) in missing_transfers(plan, store).items():
        count += len(jobs) + len(names)
        lanes += [_formulas(plan, store, reference, jobs)] if jobs else []
        lanes += [_table(plan, store, reference, name) for name in names]
    return count, lanes


def missing_transfers(plan: Plan, store: Store) -> dict[str, tuple[dict[str, FitJob], list[str]]]:
    """The fits of formulas and the names of tables that are missing, by the reference of a test material."""
    stored = store.transfers().keys()
    formulas, tables = formula_jobs(plan, store), _tables(plan, store)
    missing = {}
    for reference in plan.tests:
        jobs = {model: job for model, job in formulas.items() if (model, reference) not in stored}
        names = [name for name in tables if (name, reference) not in stored]
        if jobs or names:
            missing[reference] = jobs, names
    return missing


def formula_jobs(plan: Plan, store: Store) -> dict[str, FitJob]:
    """The fits of the formulas in front.json: of the front by expression, of baselines by name."""
    front = {expression: plan.job(expression) for expression in listed_expressions(store)}
    fitted = store.baselines()
    published = [name for name in plan.baselines if name in fitted and MODELS[name].together]
    return front | {name: plan.formula_job(name) for name in published}


def _tables(plan: Plan, store: Store) -> list[str]:
    fitted = store.baselines()
    return [name for name in plan.baselines if name in fitted and not MODELS[name].together]


def _formulas(plan: Plan, store: WritableStore, reference: str, jobs: Mapping[str, FitJob]) -> Lane:
    job = Job(
        transfer,
        plan.tests[reference],
        list(jobs.values()),
        f"transfer formulas to {material_name(reference)}",
        5.0,
    )
    yield from _fits_to(store, reference, list(jobs), job, Transfer.of_formula)


def _table(plan: Plan, store: WritableStore, reference: str, name: str) -> Lane:
    job = Job(
        summarise,
        plan.tests[reference],
        [MaterialTask(name, 0)],
        # The label starts with the name: executors measure the time per item by it.
        f"{name} baseline of {material_name(reference)}",
        10.0,
    )
    yield from _fits_to(store, reference, [name], job, lambda judged: Transfer.of_table(judged, plan.metric))


def _fits_to(
    store: WritableStore, reference: str, models: list[str], job: Job, read: Callable[[Any], Transfer]
) -> Lane:
    """Runs the fits of models to a test material and stores the results, also those before a stop.

    A model that cannot be fitted is quarantined, and tried again at the next launch.
    """
    try:
        results = yield job
    except Stopped as stopped:
        # These failures may have the same cause as the stop: they are tried again after a resume.
        fits = {i: result for i, result in stopped.results.items() if not isinstance(result, Failure)}
        _save(store, reference, models, fits, read)
        raise
    _save(store, reference, models, dict(enumerate(results)), read)


def _save(
    store: WritableStore,
    reference: str,
    models: list[str],
    results: Mapping[int, Any],
    read: Callable[[Any], Transfer],
) -> None:
    stage = f"transfer to {material_name(reference)}"
    with store.transaction():
        for index, result in results.items():
            if isinstance(result, Failure):
                store.save_quarantined([Quarantined(models[index], stage, result.reason)])
            else:
                store.save_transfer(models[index], reference, read(result))
