"""What a search remembers of fits: nothing that computes the same is ever fitted twice.

Fits are kept by canonical expression. A fit that was given up is remembered with the bar that it failed: it counts
wherever the bar is as low or lower, and is fitted again where a higher one is asked for.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fitters.expressions import grammar, parse
from fitters.expressions.canonical import Canonical, canonical
from fitters.fits import Fit

Parameters = NDArray[np.float32]
"""(targets, parameters) of a fit, columns in the order of the canonical expression's p0, p1, .."""


@dataclass(frozen=True, slots=True)
class Known:
    """A fit on the small sample. `bar` is what it failed, infinite where it was carried through.

    The error of a fit that was given up is what it had reached.
    """

    error: float
    standard_error: float = 0.0
    bar: float = math.inf


class Memory:
    """Known fits by canonical expression.

    known:      every fit so far
    seen:       size of the smallest expression of a canonical form that occurred in a whole generation
    parameters: of the parents, which do not change while their children are fitted: otherwise a warm start would
                depend on which fit is done first
    learned:    parameters of this generation's fits
    fresh:      those that are not stored yet
    """

    def __init__(self, known: dict[str, Known], seen: dict[str, int]) -> None:
        self.known, self.seen = known, seen
        self.fresh: set[str] = set()
        self.parameters: dict[str, Parameters] = {}
        self.learned: dict[str, Parameters] = {}
        self._forms: dict[str, Canonical] = {}

    def knows(self, key: str, bar: float) -> bool:
        """Whether a fit is there that is as good as one anew under this bar."""
        found = self.known.get(key)
        return found is not None and found.bar >= bar

    def learn(self, key: str, fit: Fit, bar: float) -> None:
        self.known[key] = Known(fit.error, fit.standard_error, math.inf if fit.finished else bar)
        self.learned[key] = fit.values.astype(np.float32)
        self.fresh.add(key)

    def is_new(self, key: str, nodes: int) -> bool:
        """Whether no whole generation had this expression, or only in a larger form."""
        return nodes < self.seen.get(key, math.inf)

    def form(self, expression: str) -> Canonical:
        """The canonical form of an expression in text form."""
        if expression not in self._forms:
            self._forms[expression] = canonical(parse(expression))
        return self._forms[expression]

    def parents(
        self, population: Mapping[str, Canonical], load: Callable[[list[str]], dict[str, Parameters]]
    ) -> None:
        """Keeps what children of a population need: canonical forms by expression, and parameters.

        `load` fetches the parameters that are not at hand, so that a resumed search has the same.
        """
        self._forms = dict(population)
        keys = dict.fromkeys(form.text for form in population.values())
        at_hand = self.parameters | self.learned
        found = load([key for key in keys if key not in at_hand]) | at_hand
        self.parameters = {key: found[key] for key in keys if key in found}
        self.learned = {}

    def columns(self, form: Canonical) -> dict[str, NDArray[np.float64]] | None:
        """The parameters of a known fit, each (targets,), by their own names; None where they are not at hand."""
        values = self.learned.get(form.text, self.parameters.get(form.text))
        if values is None:
            return None
        return {own: values[:, grammar.number(name)].astype(np.float64) for own, name in form.names.items()}

    def warm_start(self, child: Canonical, parent: str) -> dict[str, NDArray[np.float64]] | None:
        """The parent's parameters, each (targets,), under the names that they have in the child's canonical form.

        A parameter that the parent has not begins at 1. None where nothing is known of the parent.
        """
        form = self.form(parent)
        values = self.parameters.get(form.text)
        if values is None or not child.names:
            return None
        columns = {}
        for own, name in child.names.items():
            inherited = own in form.names
            column = values[:, grammar.number(form.names[own])] if inherited else np.ones(len(values))
            columns[name] = column.astype(np.float64)
        return columns
