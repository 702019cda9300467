"""What is computed beside the search: baselines before it, and full descriptions of the front after it."""

from collections.abc import Sequence
from typing import Any

from fitters.fitting import Description, DescriptionJob, describe
from fitters.fitting.culling import CullJob, cull
from fitters.models import MODELS, Fitter
from gpsearch.run import Member, Quarantined, Store, WritableStore
from gpsearch.search.plan import Plan
from workers import Failure, Job, Lane


def baseline_lanes(plan: Plan, store: WritableStore) -> tuple[int, list[Lane]]:
    """Lanes that fit and store the baselines that are not there yet, and how many tasks they have in all."""
    fitters = [MODELS[name] for name in plan.baselines if name not in store.baselines()]
    # One task over all materials takes longest.
    fitters.sort(key=lambda fitter: not fitter.together)
    lanes = [_baseline(plan, store, fitter) for fitter in fitters]
    return sum(fitter.count_tasks(plan.materials) for fitter in fitters), lanes


def _baseline(plan: Plan, store: WritableStore, fitter: Fitter) -> Lane:
    """One stage after the other; the baseline is stored after the last."""
    stages = fitter.stages(plan.materials, plan.settings)
    stage = next(stages)
    while True:
        results = yield Job(stage.function, plan.recipe, list(stage.tasks), stage.label, stage.seconds)
        if _failed(store, fitter.name, results):
            return
        try:
            stage = stages.send(results)
        except StopIteration as end:
            with store.transaction():
                store.save_baseline(fitter.name, end.value)
            return


def _failed(store: WritableStore, name: str, results: Sequence[Any]) -> bool:
    """Whether a baseline could not be computed: it is quarantined, and tried again at the next launch."""
    failures = [result for result in results if isinstance(result, Failure)]
    if failures:
        with store.transaction():
            store.save_quarantined([Quarantined(name, "baseline", failures[0].reason)])
    return bool(failures)


def unfinished(store: Store, members: Sequence[Member]) -> list[Member]:
    """The members that are not described yet, or are still to be culled."""
    described, culled = store.descriptions(), store.culled()
    return [m for m in members if m.expression not in described or culled.get(m.expression, m) is None]


def description_lanes(plan: Plan, store: WritableStore, members: Sequence[Member]) -> tuple[int, list[Lane]]:
    """Lanes that describe and cull members on all cells, and store each step, and how many steps they have in all.

    A member that cannot be described is quarantined: no export has it. One that cannot be culled is, too, and
    stays as it is. Either is tried again at the next launch.
    """
    described = store.descriptions()
    steps = sum((m.expression not in described) + (plan.culling > 0) for m in members)
    return steps, [_description(plan, store, m, described.get(m.expression)) for m in members]


def _description(plan: Plan, store: WritableStore, member: Member, description: Description | None) -> Lane:
    """`description` is there where the member is only left to be culled."""
    job = plan.job(member.expression)
    if description is None:
        (described,) = yield Job(describe, plan.recipe, [DescriptionJob(job, member.fit)], "describe front", 1.0)
        with store.transaction():
            if isinstance(described, Failure):
                store.save_quarantined([_quarantined(member, "describe", described)])
                return
            store.save_description(member.expression, described, to_cull=plan.culling > 0)
        description = described
    if plan.culling > 0:
        task = CullJob(job, description, plan.culling)
        (culled,) = yield Job(cull, plan.recipe, [task], "cull front", 10.0)
        with store.transaction():
            if isinstance(culled, Failure):
                store.save_quarantined([_quarantined(member, "cull", culled)])
            else:
                store.save_culled(member.expression, culled)


def _quarantined(member: Member, stage: str, failure: Failure) -> Quarantined:
    return Quarantined(member.expression, stage, failure.reason, member.island, member.generation)
