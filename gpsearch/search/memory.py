"""What islands know of earlier fits, so that expressions that compute the same are not fitted twice.

Fits are kept by canonical expression. A fit that was given up is kept with the bar that it did not reach: it
counts where the bar is as low or lower; under a higher bar the expression is fitted again.

Between two migrations an island knows what all islands knew at the first of them, and its own results since then.
So its decisions do not depend on how fast other islands are.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fitters.expressions import grammar, parse
from fitters.expressions.canonical import Canonical, canonical
from fitters.fitting import Fit
from gpsearch.evolution.island import Island
from gpsearch.run import Front, Known, Member, Store

Parameters = NDArray[np.float32]
"""(targets, parameters) of a fit, columns in the order of the canonical expression's p0, p1, .."""

Load = Callable[[Mapping[str, Known]], dict[str, Parameters]]
"""Reads the stored parameters of fits, by canonical expression."""


@dataclass
class SharedKnowledge:
    """What all islands know since their last migration.

    fits:  by canonical expression
    sizes: number of nodes of the smallest expression of a canonical form that has occurred, by that form
    front: of the confirmed candidates of all islands
    forms: canonical forms of the populations at the migration, by expression
    """

    fits: dict[str, Known] = field(default_factory=dict)
    sizes: dict[str, int] = field(default_factory=dict)
    front: Front = field(default_factory=Front)
    forms: dict[str, Canonical] = field(default_factory=dict)

    def add_fits(self, fits: Iterable[tuple[str, Known]]) -> None:
        """Of two fits of one form it keeps the one with the higher bar, and of equal bars the older one."""
        for key, fit in fits:
            before = self.fits.get(key)
            if before is None or fit.precedence < before.precedence:
                self.fits[key] = fit

    def add_sizes(self, sizes: Iterable[tuple[str, int]]) -> None:
        for key, nodes in sizes:
            self.sizes[key] = min(nodes, self.sizes.get(key, nodes))

    def join(self, memories: Iterable["Memory"]) -> None:
        """Adds the results of islands; their order does not matter."""
        self.forms = {}
        for memory in memories:
            self.forms |= memory.forms
            self.add_fits(memory.fits.items())
            self.add_sizes(memory.sizes.items())
            self.front = self.front.updated(memory.front.members)


class Memory:
    """What one island knows.

    front:          of what all islands had confirmed at the last migration, and this island since then
    fits:           of the island's finished generations since the last migration, by canonical expression
    new_fits:       of the current generation
    new_parameters: parameters of `new_fits`
    sizes:          as in `SharedKnowledge`, of the island's generations since the last migration
    forms:          canonical forms of the population, by expression
    """

    def __init__(self, island: int, shared: SharedKnowledge) -> None:
        self.island, self.shared = island, shared
        self.front = shared.front
        self.fits: dict[str, Known] = {}
        self.new_fits: dict[str, Known] = {}
        self.new_parameters: dict[str, Parameters] = {}
        self.sizes: dict[str, int] = {}
        self.forms: dict[str, Canonical] = {}
        self._parents: dict[str, Parameters] = {}

    def __getitem__(self, key: str) -> Known:
        """The fit of a canonical expression. Raises `KeyError` where there is none."""
        fit = self.find(key)
        if fit is None:
            raise KeyError(key)
        return fit

    def find(self, key: str) -> Known | None:
        return self.new_fits.get(key) or self._before(key)

    def _before(self, key: str) -> Known | None:
        """The fit that was known when the current generation began."""
        return self.fits.get(key) or self.shared.fits.get(key)

    def knows(self, key: str, bar: float) -> bool:
        """Whether there is a fit that a new one with this bar would not improve on."""
        fit = self.find(key)
        return fit is not None and fit.bar >= bar

    def learn(self, key: str, fit: Fit, bar: float, generation: int) -> None:
        """Adds a fit to the current generation."""
        reached = math.inf if fit.finished else bar
        self.new_fits[key] = Known(fit.error, fit.standard_error, reached, self.island, generation)
        self.new_parameters[key] = fit.values.astype(np.float32)

    def learn_failure(self, form: Canonical, targets: int, generation: int) -> None:
        """Records that the form cannot be fitted, so that it is never tried again."""
        self.new_fits[form.text] = Known(math.inf, 0.0, math.inf, self.island, generation)
        self.new_parameters[form.text] = np.ones((targets, len(form.names)), np.float32)

    def smallest(self, key: str) -> float:
        """The size of the smallest expression of this form that has occurred, or infinity."""
        return min(self.sizes.get(key, math.inf), self.shared.sizes.get(key, math.inf))

    def end_generation(self, confirmed: Iterable[Member], sizes: Mapping[str, int]) -> None:
        """The fits of the current generation become fits of a finished one."""
        self.front = self.front.updated(confirmed)
        self.fits |= self.new_fits
        self.new_fits = {}
        self.sizes |= sizes

    # parents

    def form(self, expression: str) -> Canonical:
        """The canonical form of an expression in text form."""
        if expression not in self.forms:
            self.forms[expression] = canonical(parse(expression))
        return self.forms[expression]

    def parents(self, population: Iterable[str], forms: Mapping[str, Canonical], load: Load) -> None:
        """Prepares what the children of a population need: canonical forms by expression, and parameters.

        Some `forms` are known already, and the parameters of the last generation. `load` reads the others, so that
        a resumed search has the same ones.
        """
        known_forms = forms or self.shared.forms
        self.forms = {text: known_forms.get(text) or canonical(parse(text)) for text in sorted(population)}
        fits = {form.text: self._before(form.text) for form in self.forms.values()}
        recent = {key: values for key, values in self.new_parameters.items() if key in fits and key in self.fits}
        stored = {key: fit for key, fit in fits.items() if fit is not None and key not in recent}
        self._parents = load(stored) | recent
        self.new_parameters = {}

    def parameters(self, keys: Iterable[str], load: Load) -> dict[str, Parameters]:
        """The parameters of known fits."""
        recent = self.new_parameters
        return load({key: self[key] for key in keys if key not in recent}) | recent

    def warm_start(self, child: Canonical, parent: str) -> dict[str, NDArray[np.float64]] | None:
        """The parent's parameters, each (targets,), under the names that they have in the child's canonical form.

        A parameter that the parent does not have starts at 1. None where the parent has no fit.
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


class StoredKnowledge:
    """What islands knew when a run stopped, from its store. The last migration was in generation `migration`."""

    def __init__(self, store: Store, migration: int) -> None:
        self._migration = migration
        fits = ((known.island, known.generation, (key, known)) for key, known in store.fits())
        sizes = ((island, generation, (key, nodes)) for key, island, generation, nodes in store.seen())
        self._fits, self._sizes, self._confirmed = map(self._split, (fits, sizes, store.confirmed()))

    def _split(self, rows: Iterable[tuple[int, int, Any]]) -> "_Split":
        """Splits rows of (island, generation, result) at the last migration."""
        split = _Split()
        for island, generation, result in rows:
            if generation <= self._migration:
                split.before.append(result)
            else:
                split.since.setdefault(island, []).append((generation, result))
        return split

    def shared(self) -> SharedKnowledge:
        """What all islands knew at the last migration."""
        shared = SharedKnowledge()
        shared.add_fits(self._fits.before)
        shared.add_sizes(self._sizes.before)
        shared.front = shared.front.updated(self._confirmed.before)
        return shared

    def restore(self, memory: Memory, island: Island) -> None:
        """Adds the island's results since the last migration; those of its unfinished generation are new fits."""
        for generation, (key, known) in self._fits.of(island.number):
            (memory.fits if generation <= island.generation else memory.new_fits)[key] = known
        for _, (key, nodes) in self._sizes.of(island.number):
            memory.sizes[key] = nodes
        memory.front = memory.front.updated(member for _, member in self._confirmed.of(island.number))


class _Split:
    """Results before the last migration, and those since then, with their generations, by island."""

    def __init__(self) -> None:
        self.before: list[Any] = []
        self.since: dict[int, list[tuple[int, Any]]] = {}

    def of(self, island: int) -> list[tuple[int, Any]]:
        """By rising generation."""
        return sorted(self.since.get(island, []), key=lambda row: row[0])
