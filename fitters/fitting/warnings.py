"""Where a fitted formula is not to be relied on, in sentences: what a user cannot see from its error."""

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from fitters.expressions import Expression
from fitters.fitting.cell_fit import Fit, fit_cells, refit_cells
from fitters.fitting.cells import Cells
from fitters.fitting.conditioning import Conditioning, conditioning
from fitters.fitting.problem import Problem
from fitters.fitting.settings import Bounds, FitSettings
from fitters.grid import CHANNELS, Array, above_horizon

CELLS_PER_PARAMETER = 10
"""Of a target in effect; with fewer, the parameters follow single cells."""
UNMEASURED = 0.02
"""Of the light: what the formula says there is extrapolated."""
OTHER_STARTS = 3
"""Quick fits from other starts, which tell whether starts matter."""
APART = 0.1
"""They do where one ends more than this above the fit that is kept, relative, and ..."""
LEAST_APART = 1e-3
"""... more than this in the error itself: between two exact fits any ratio may stand."""


def warnings_of(
    expression: Expression, problem: Problem, bounds: Bounds, settings: FitSettings, fit: Fit
) -> tuple[str, ...]:
    """Of a polished fit; costs about as much as a few screenings."""
    if not np.isfinite(fit.error):
        return ()
    each = conditioning(expression, problem.fine, bounds, fit)
    return (
        *_about_materials(problem),
        *_about_units(problem),
        *_about_light(problem, len(expression.parameters)),
        *_about_zeros(problem),
        *_about_trade_offs(problem, each),
        *_about_bounds(problem, each),
        *_about_starts(
            problem,
            restart_errors(expression, problem, bounds, settings),
            _kept(expression, problem, bounds, settings, fit),
        ),
    )


def _about_materials(problem: Problem) -> tuple[str, ...]:
    return tuple(f"{material.name}: {said}" for material in problem.materials for said in material.doubts)


def _about_units(problem: Problem) -> tuple[str, ...]:
    units = problem.full.units
    if units is None:
        return ()
    strange = np.flatnonzero(units != 1.0)
    least, most = float(units[strange].min()), float(units[strange].max())
    level = f"{least:.0e}" if least == most else f"{least:.0e} to {most:.0e}"
    return (
        f"{_named(problem, strange)}: values of about {level} are no reflectance in sr^-1; the bounds of linear "
        "parameters count in this unit",
    )


def restart_errors(expression: Expression, problem: Problem, bounds: Bounds, settings: FitSettings) -> Array:
    """Errors (OTHER_STARTS, targets) on the sample, of quick fits from starts of their own."""
    ends = [
        fit_cells(expression, problem.sample, problem.metric, bounds, settings, shift=1 + i).errors
        for i in range(OTHER_STARTS if expression.parameters else 0)
    ]
    return np.stack(ends) if ends else np.empty((0, len(problem.targets)))


def _kept(expression: Expression, problem: Problem, bounds: Bounds, settings: FitSettings, fit: Fit) -> Array:
    """Errors (targets,) of the fit that is kept on the same cells."""
    stays = refit_cells(expression, problem.sample, problem.metric, bounds, fit.columns, settings, evaluations=0)
    return stays.errors


def effective_cells(cells: Cells, target: int) -> float:
    """How many cells a target's measured light comes from in effect: (sum of shares)^2 / sum of their squares."""
    shares = np.square(cells.targets[target], dtype=np.float64)
    total = float(np.sum(np.square(shares)))
    return float(np.sum(shares)) ** 2 / total if total > 0 else float(np.count_nonzero(cells.weights[target]))


def _about_light(problem: Problem, parameters: int) -> tuple[str, ...]:
    counts = [effective_cells(problem.full, target) for target in range(len(problem.targets))]
    lit = [i for i in range(len(counts)) if problem.full.weights[i].any()]
    few = [i for i in lit if counts[i] < CELLS_PER_PARAMETER * parameters]
    dark = [i for i in range(len(counts)) if i not in lit]
    said = list(_about_unmeasured(problem))
    if few:
        said.append(
            f"{_named(problem, few)}: the light comes from {min(counts[i] for i in few):.0f} cells in effect, few "
            f"for {parameters} parameters: other directions are extrapolated"
        )
    if dark:
        said.append(
            f"{_named(problem, dark)}: the scene has no light of this colour; the parameters are arbitrary"
        )
    return tuple(said)


def _about_unmeasured(problem: Problem) -> tuple[str, ...]:
    light, above = problem.light.table.sum(axis=0), above_horizon()
    total, said = float(light[above].sum()), []
    for material in problem.materials:
        missing = float(light[above & ~material.valid].sum()) / total
        if missing > UNMEASURED:
            said.append(f"{material.name}: {missing:.0%} of the light falls on directions that were not measured")
    return tuple(said)


def _about_zeros(problem: Problem) -> tuple[str, ...]:
    rows = zip(problem.full.weights, problem.full.targets, strict=True)
    empty = [i for i, (weights, targets) in enumerate(rows) if weights.any() and not targets.any()]
    if not empty:
        return ()
    return (f"{_named(problem, empty)}: zero wherever there is light, so that the error is in sr^-1",)


def _about_trade_offs(problem: Problem, each: Sequence[Conditioning]) -> tuple[str, ...]:
    said = []
    for words, targets in _grouped(each, lambda one: [in_words(flat) for flat in one.flat]).items():
        worst = max(each[i].condition for i in targets)
        said.append(f"{_named(problem, targets)}: {words} (condition number up to {worst:.0e})")
    return tuple(said)


def in_words(flat: Mapping[str, float]) -> str:
    """`p1 and p3 trade off`: parameters that may change together without changing what the scene shows."""
    names = list(flat)
    if len(names) == 1:
        return f"{names[0]} hardly matters"
    return f"{', '.join(names[:-1])} and {names[-1]} trade off against each other"


def _about_bounds(problem: Problem, each: Sequence[Conditioning]) -> tuple[str, ...]:
    stuck = _grouped(
        each, lambda one: [f"{name} stands at its bound {side:g}" for name, side in one.at_bounds.items()]
    )
    return tuple(f"{_named(problem, targets)}: {words}" for words, targets in stuck.items())


def _about_starts(problem: Problem, ends: Array, kept: Array) -> tuple[str, ...]:
    if not len(ends):
        return ()
    above = np.max(ends, axis=0) - kept
    apart = np.flatnonzero(above > np.maximum(APART * kept, LEAST_APART))
    if not len(apart):
        return ()
    worst = float(np.max(above[apart] / np.maximum(kept[apart], LEAST_APART)))
    return (
        f"{_named(problem, apart)}: quick fits from other starts end up to {worst:.0%} higher: there are other "
        "valleys, and a better one may be unknown",
    )


def _grouped(
    each: Sequence[Conditioning], sentences: Callable[[Conditioning], Iterable[str]]
) -> dict[str, list[int]]:
    """Sentences, and the targets of which each is true."""
    by_sentence: dict[str, list[int]] = {}
    for target, one in enumerate(each):
        for sentence in sentences(one):
            by_sentence.setdefault(sentence, []).append(target)
    return by_sentence


def _named(problem: Problem, targets: Iterable[int]) -> str:
    """`metal (red, blue), steel`: materials, with their channels where these are not all."""
    by_material: dict[str, list[str]] = {}
    for target in targets:
        material, channel = problem.targets[target]
        by_material.setdefault(material, []).append(channel)
    return ", ".join(
        name if len(channels) == len(CHANNELS) else f"{name} ({', '.join(channels)})"
        for name, channels in by_material.items()
    )
