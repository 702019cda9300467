"""Which reductions a formula takes, one after the other: always the one that saves most for the error it costs.

Most reductions cost about as much after another one as before it. So they wait in a queue by what they cost when
they were last tried, and only the first of the queue is tried again: Minoux's accelerated greedy algorithm (1978).
What is far from possible once is not tried again.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from heapq import heapify, heappop, heappush
from math import inf

import numpy as np

from fitters.expressions import Expression, grammar, to_text
from fitters.expressions.evaluation import evaluate_features
from fitters.fitting.cell_fit import HOPELESS, Fit, fit_cells, refit_cells
from fitters.fitting.culling.reductions import Reduction, complexity, reductions
from fitters.fitting.problem import Problem
from fitters.fitting.settings import Bounds, FitSettings
from fitters.grid import Array
from fitters.judging.checks import reciprocity

SHORT = 10
"""Evaluations per searched parameter of the descent that most reductions are judged by."""

FREE = 1e-4
"""Relative growth of the error that counts as none: what costs less is taken by what it saves."""

RECIPROCAL = 1e-6
"""Relative difference of f(w_i, w_o) and f(w_o, w_i) up to which a formula is reciprocal."""


@dataclass(frozen=True)
class Step:
    """One reduction that was taken.

    what:          `deleted`, `simplified`, `parameter dropped` or `constant snapped`
    before, after: text of the subexpression, parameters under the names that they have in the original
    nodes, error:  of the whole formula, before and after; the error on the fine sample
    """

    what: str
    before: str
    after: str
    nodes: tuple[int, int]
    error: tuple[float, float]


@dataclass(frozen=True)
class Demands:
    """What every formula on the way must meet: errors on the two samples, and what a renderer asks for.

    nothing: an error that is none
    """

    sample: float
    fine: float
    nothing: float
    reciprocal: bool
    nonnegative: bool


@dataclass(frozen=True, eq=False)
class Stage:
    """A formula on the way, its fits on the two samples, and the step that led to it."""

    expression: Expression
    sample: Fit
    fine: Fit
    step: Step | None = None


class Greedy:
    """The way of one formula down. `prices` is all that changes: cost per saving, when last tried."""

    def __init__(self, problem: Problem, bounds: Bounds, settings: FitSettings, demands: Demands) -> None:
        self.problem, self.bounds, self.settings, self.demands = problem, bounds, settings, demands
        self.prices: dict[tuple[Expression, Expression], float] = {}

    def trail(self, start: Stage) -> list[Stage]:
        """The formula and what it becomes, step by step, until no reduction is possible."""
        stages = [start]
        while (following := self._next(stages[-1])) is not None:
            stages.append(following)
        return stages

    def _next(self, stage: Stage) -> Stage | None:
        """The formula after the cheapest reduction that is possible; None where none is."""
        names = stage.expression.parameters
        spare = next((name for name in self.bounds if name not in names), None)
        typical = {name: float(np.median(values)) for name, values in stage.sample.columns.items()}
        open_ones = reductions(stage.expression, typical, spare)
        tried: dict[int, Fit] = {}
        queue = [(self.prices.get(one.key, -inf), i) for i, one in enumerate(open_ones)]
        queue = [entry for entry in queue if entry[0] < inf]
        heapify(queue)
        while queue:
            _, i = heappop(queue)
            one = open_ones[i]
            if i not in tried:
                tried[i] = self._tried(stage, one, spare)
                price = self.prices[one.key] = self._price(stage, one, tried[i])
                if price < inf:
                    heappush(queue, (price, i))
            elif tried[i].error <= self._limit(stage, one) and (taken := self._taken(stage, one, tried[i])):
                return taken
        return None

    def _tried(self, stage: Stage, one: Reduction, spare: str | None) -> Fit:
        """The fit of a reduction on the small sample: from the parameters before it, and where that is not enough
        from anywhere.
        """
        near: dict[str, Array] = {
            name: stage.sample.columns[name] for name in one.whole.parameters if name != spare
        }
        if spare in one.whole.parameters:
            near[spare] = self._means(one.before, stage.sample)
        cells, metric, bounds, settings = self.problem.sample, self.problem.metric, self.bounds, self.settings
        close = refit_cells(one.whole, cells, metric, bounds, near, settings, evaluations=SHORT)
        if close.error <= self.demands.sample:
            return close
        afar = fit_cells(one.whole, cells, metric, bounds, settings, near=close.columns, bar=self.demands.sample)
        return afar if afar.finished and afar.error < close.error else close

    def _means(self, node: Expression, fit: Fit) -> Array:
        """Values (targets,) of a subexpression of a fitted formula, where the measurement is bright."""
        cells = self.problem.sample
        values = [evaluate_features(node, fit.parameters(i), cells.features) for i in range(len(fit.values))]
        shares = np.square(cells.targets, dtype=np.float64)
        with np.errstate(all="ignore"):
            return np.nan_to_num(np.sum(shares * values, axis=1) / np.sum(shares, axis=1), nan=1.0)

    def _price(self, stage: Stage, one: Reduction, fit: Fit) -> float:
        """Growth of the error per node and parameter saved; infinite for what is hopeless."""
        if not fit.error <= HOPELESS * self.demands.sample:
            return inf
        growth = (fit.error - stage.sample.error) / self.demands.sample
        return max(growth, FREE) / max(_saved(stage, one), 0.1)

    def _limit(self, stage: Stage, one: Reduction) -> float:
        """The error that a reduction may leave; what saves a parameter or digits but no node must not cost any."""
        free = max(stage.sample.error * (1.0 + FREE), self.demands.nothing)
        smaller = one.whole.nodes < stage.expression.nodes
        return self.demands.sample if smaller else min(self.demands.sample, free)

    def _taken(self, stage: Stage, one: Reduction, fit: Fit) -> Stage | None:
        """The stage after a reduction; None where it fails on the fine sample or as a reflectance."""
        problem, fitted = self.problem, fit.columns
        fine = refit_cells(
            one.whole, problem.fine, problem.metric, self.bounds, fitted, self.settings, evaluations=SHORT
        )
        if not (fine.error <= self.demands.fine and self._sound(one.whole, fine)):
            return None
        sizes = (stage.expression.nodes, one.whole.nodes)
        step = Step(one.what, to_text(one.before), to_text(one.after), sizes, (stage.fine.error, fine.error))
        return Stage(one.whole, fit, fine, step)

    def _sound(self, expression: Expression, fit: Fit) -> bool:
        if self.demands.nonnegative and not _minimum(expression, fit, self.problem.fine.features) >= 0.0:
            return False
        return not self.demands.reciprocal or reciprocity(expression, fit) <= RECIPROCAL


def _saved(stage: Stage, one: Reduction) -> int:
    """Nodes and parameters that a reduction saves."""
    return complexity(stage.expression)[0] - complexity(one.whole)[0]


def _minimum(expression: Expression, fit: Fit, features: Mapping[str, Array]) -> float:
    values = (evaluate_features(expression, fit.parameters(i), features) for i in range(len(fit.values)))
    return float(np.min([value.min() for value in values]))


def contiguous(expression: Expression) -> dict[str, str]:
    """New names p0, p1, .. for the parameters of an expression, in their order."""
    names = sorted(expression.parameters, key=grammar.number)
    return {name: f"p{i}" for i, name in enumerate(names)}
