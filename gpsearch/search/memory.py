"""What islands remember of fits: nothing that computes the same is fitted twice by whoever knows of it.

Fits are kept by canonical expression. A fit that was given up is remembered with the bar that it failed: it counts
wherever the bar is as low or lower, and is fitted again where a higher one is asked for.

Between two migrations an island knows what all knew at the first of them, and what it has found itself since. So
what it does depends on nobody's pace but its own.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fitters.expressions import grammar, parse
from fitters.expressions.canonical import Canonical, canonical
from fitters.fitting import Fit
from gpsearch.run import Front, Known, Member

Parameters = NDArray[np.float32]
"""(targets, parameters) of a fit, columns in the order of the canonical expression's p0, p1, .."""

Load = Callable[[Mapping[str, Known]], dict[str, Parameters]]
"""Fetches the stored parameters of fits, by canonical expression."""


@dataclass
class Shared:
    """What all islands know since their last migration.

    known: fits by canonical expression
    seen:  size of the smallest expression of a canonical form that has occurred
    front: of what all had confirmed
    forms: canonical forms of the populations then, by expression
    """

    known: dict[str, Known] = field(default_factory=dict)
    seen: dict[str, int] = field(default_factory=dict)
    front: Front = field(default_factory=Front)
    forms: dict[str, Canonical] = field(default_factory=dict)

    def learn(self, fits: Iterable[tuple[str, Known]]) -> None:
        """Of two fits of a form counts the one that was carried further, or else the older one."""
        for key, fit in fits:
            before = self.known.get(key)
            if before is None or fit.precedence < before.precedence:
                self.known[key] = fit

    def see(self, sizes: Iterable[tuple[str, int]]) -> None:
        for key, nodes in sizes:
            self.seen[key] = min(nodes, self.seen.get(key, nodes))

    def join(self, memories: Iterable["Memory"]) -> None:
        """Adds what islands have found by themselves, whatever the order."""
        self.forms = {}
        for memory in memories:
            self.forms |= memory.forms
            self.learn(memory.own.items())
            self.see(memory.sizes.items())
            self.front = self.front.updated(memory.front.members)


class Memory:
    """What one island knows.

    front:   of what all had confirmed at the last migration, and the island since
    own:     fits of its whole generations since then
    fresh:   fits of the generation that is under way
    learned: parameters of the latter
    forms:   canonical forms of the population, by expression
    sizes:   what it has seen since the last migration
    """

    def __init__(self, island: int, shared: Shared) -> None:
        self.island, self.shared = island, shared
        self.front = shared.front
        self.own: dict[str, Known] = {}
        self.fresh: dict[str, Known] = {}
        self.learned: dict[str, Parameters] = {}
        self.sizes: dict[str, int] = {}
        self._parents: dict[str, Parameters] = {}
        self.forms: dict[str, Canonical] = {}

    def __getitem__(self, key: str) -> Known:
        """The fit of a form that is known."""
        found = self.find(key)
        if found is None:
            raise KeyError(key)
        return found

    def find(self, key: str) -> Known | None:
        return self.fresh.get(key) or self._before(key)

    def _before(self, key: str) -> Known | None:
        """What was known when this generation began."""
        return self.own.get(key) or self.shared.known.get(key)

    def knows(self, key: str, bar: float) -> bool:
        """Whether a fit is there that is as good as one anew under this bar."""
        found = self.find(key)
        return found is not None and found.bar >= bar

    def learn(self, key: str, fit: Fit, bar: float, generation: int) -> None:
        reached = math.inf if fit.finished else bar
        self.fresh[key] = Known(fit.error, fit.standard_error, reached, self.island, generation)
        self.learned[key] = fit.values.astype(np.float32)

    def learn_failure(self, form: Canonical, targets: int, generation: int) -> None:
        """The form has no fit, and will never be asked for again."""
        self.fresh[form.text] = Known(math.inf, 0.0, math.inf, self.island, generation)
        self.learned[form.text] = np.ones((targets, len(form.names)), np.float32)

    def seen(self, key: str) -> float:
        """The size of the smallest expression of this form that has occurred, or infinity."""
        return min(self.sizes.get(key, math.inf), self.shared.seen.get(key, math.inf))

    def end_generation(self, confirmed: Iterable[Member], sizes: Mapping[str, int]) -> None:
        """What is fresh becomes the island's own."""
        self.front = self.front.updated(confirmed)
        self.own |= self.fresh
        self.fresh = {}
        self.sizes |= sizes

    # parents

    def form(self, expression: str) -> Canonical:
        """The canonical form of an expression in text form."""
        if expression not in self.forms:
            self.forms[expression] = canonical(parse(expression))
        return self.forms[expression]

    def parents(self, population: Iterable[str], forms: Mapping[str, Canonical], load: Load) -> None:
        """Keeps what children of a population need: canonical forms by expression, and parameters.

        What was learned last is at hand, and so are `forms`; `load` fetches the rest, so that a resumed search has
        the same.
        """
        at_hand_forms = forms or self.shared.forms
        self.forms = {text: at_hand_forms.get(text) or canonical(parse(text)) for text in sorted(population)}
        known = {form.text: self._before(form.text) for form in self.forms.values()}
        at_hand = {key: values for key, values in self.learned.items() if key in known and key in self.own}
        wanted = {key: fit for key, fit in known.items() if fit is not None and key not in at_hand}
        self._parents = load(wanted) | at_hand
        self.learned = {}

    def parameters(self, keys: Iterable[str], load: Load) -> dict[str, Parameters]:
        """The parameters of known fits."""
        at_hand = self.learned
        return load({key: self[key] for key in keys if key not in at_hand}) | at_hand

    def warm_start(self, child: Canonical, parent: str) -> dict[str, NDArray[np.float64]] | None:
        """The parent's parameters, each (targets,), under the names that they have in the child's canonical form.

        A parameter that the parent has not begins at 1. None where nothing is known of the parent.
        """
        form = self.form(parent)
        values = self._parents.get(form.text)
        if values is None or not child.names:
            return None
        columns = {}
        for own, name in child.names.items():
            inherited = own in form.names
            column = values[:, grammar.number(form.names[own])] if inherited else np.ones(len(values))
            columns[name] = column.astype(np.float64)
        return columns


def named(values: Parameters, form: Canonical) -> dict[str, NDArray[np.float64]]:
    """Parameters of a form's fit, each (targets,), by the names that they have in the expression itself."""
    return {own: values[:, grammar.number(name)].astype(np.float64) for own, name in form.names.items()}
