"""What is computed after a search: all that it lists, fitted to the test materials."""

from collections.abc import Callable, Mapping
from typing import Any

from fitters.fitting import FitJob, transfer
from fitters.models.baselines import TABULATED, BaselineJob, judge_baseline
from gpsearch.configuration.materials import material_name
from gpsearch.run import Quarantined, Store, Transfer, listed_formulas
from gpsearch.search.plan import Plan
from workers import Failure, Job, Lane, Stopped


def transfer_lanes(plan: Plan, store: Store) -> tuple[int, list[Lane]]:
    """Lanes that fit what is missing to test materials, and how many fits they have in all.

    The lanes of a material follow each other, so that a process goes through one after the other and holds no
    more than one of them at a time.
    """
    there = store.transfers().keys()
    formulas, tables = formula_jobs(plan, store), _tables(plan, store)
    count, lanes = 0, []
    for reference in plan.tests:
        jobs = {model: job for model, job in formulas.items() if (model, reference) not in there}
        names = [name for name in tables if (name, reference) not in there]
        count += len(jobs) + len(names)
        lanes += [_formulas(plan, store, reference, jobs)] if jobs else []
        lanes += [_table(plan, store, reference, name) for name in names]
    return count, lanes


def formula_jobs(plan: Plan, store: Store) -> dict[str, FitJob]:
    """The fits of what front.json lists as formulas: by expression of what was found, by name of the baselines."""
    found = {formula.expression: plan.job(formula.expression) for formula in listed_formulas(store)}
    fitted = store.baselines()
    published = [name for name in plan.baselines if name in fitted and name not in TABULATED]
    return found | {name: plan.formula_job(name) for name in published}


def _tables(plan: Plan, store: Store) -> list[str]:
    fitted = store.baselines()
    return [name for name in plan.baselines if name in fitted and name in TABULATED]


def _formulas(plan: Plan, store: Store, reference: str, jobs: Mapping[str, FitJob]) -> Lane:
    job = Job(
        transfer,
        plan.tests[reference],
        list(jobs.values()),
        f"transfer formulas to {material_name(reference)}",
        5.0,
    )
    yield from _kept(store, reference, list(jobs), job, Transfer.of_formula)


def _table(plan: Plan, store: Store, reference: str, name: str) -> Lane:
    job = Job(
        judge_baseline,
        plan.tests[reference],
        [BaselineJob(name, 0)],
        # Each has a cost of its own, which its name begins with.
        f"{name} baseline of {material_name(reference)}",
        10.0,
    )
    yield from _kept(store, reference, [name], job, lambda judged: Transfer.of_table(judged, plan.metric))


def _kept(store: Store, reference: str, models: list[str], job: Job, read: Callable[[Any], Transfer]) -> Lane:
    """Runs the fits of models to a test material, and stores what there is of them also where they are stopped.

    What cannot be fitted is quarantined, and tried again at the next launch.
    """
    try:
        results = yield job
    except Stopped as stopped:
        # What failed may have done so for the same reason as what stops us: it is tried again.
        fits = {i: result for i, result in stopped.results.items() if not isinstance(result, Failure)}
        _save(store, reference, models, fits, read)
        raise
    _save(store, reference, models, dict(enumerate(results)), read)


def _save(
    store: Store, reference: str, models: list[str], results: Mapping[int, Any], read: Callable[[Any], Transfer]
) -> None:
    stage = f"transfer to {material_name(reference)}"
    with store.transaction():
        for index, result in results.items():
            if isinstance(result, Failure):
                store.save_quarantined([Quarantined(models[index], stage, result.reason)])
            else:
                store.save_transfer(models[index], reference, read(result))
