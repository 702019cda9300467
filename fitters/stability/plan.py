"""Which trials a run makes, and which it leaves out and why."""

from collections.abc import Sequence

from fitters.stability.hazards import HAZARDS
from fitters.stability.methods import METHODS
from fitters.stability.trial import UNDISTURBED, Trial


def trials_of(methods: Sequence[str], hazards: Sequence[str], seeds: int, any_material: bool) -> list[Trial]:
    """All trials, case by case, so that a case is made once; the undisturbed material first.

    Seeds that change neither the case nor what the method does give nothing new and are left out. With
    `any_material`, hazards that need a formula of their own are left out.
    """
    cases = [(UNDISTURBED, 0, False)]
    for name in hazards:
        hazard = HAZARDS[name]
        if hazard.any_base or not any_material:
            cases += [(name, level, hazard.random) for level in range(len(hazard.levels))]
    return [
        Trial(method, name, level, seed)
        for name, level, random in cases
        for seed in range(seeds)
        for method in methods
        if seed == 0 or random or METHODS[method].seeded
    ]


def skipped(methods: Sequence[str], hazards: Sequence[str], seeds: int, any_material: bool) -> list[str]:
    """What the trials leave out, in sentences."""
    said = []
    if missing := [name for name in METHODS if name not in methods]:
        said.append(f"methods not asked for: {', '.join(missing)}")
    if missing := [name for name in HAZARDS if name not in hazards]:
        said.append(f"hazards not asked for: {', '.join(missing)}")
    if any_material and (own := [name for name in hazards if not HAZARDS[name].any_base]):
        said.append(f"hazards that are formulas of their own, of which a material has none: {', '.join(own)}")
    fixed = [name for name in methods if not METHODS[name].seeded]
    if seeds > 1 and fixed:
        said.append(f"further seeds of {', '.join(fixed)} where the hazard does not depend on the seed either")
    return said


def level_names() -> dict[tuple[str, int], str]:
    """The name of every level of every hazard."""
    return {(hazard.name, i): level for hazard in HAZARDS.values() for i, level in enumerate(hazard.levels)}
