"""What a run keeps of its baselines: published formulas refitted, and reference fits that are no formulas."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from fitters.fitting import RESIDUALS, Description
from fitters.models.baselines import FAMILIES, Judged


@dataclass(frozen=True)
class FormulaBaseline:
    """A published formula fitted to all targets, and how long that took."""

    description: Description
    fit_seconds: float


@dataclass(frozen=True)
class TabulatedBaseline:
    """A reference fit that is no formula, over all materials.

    kind:        one of `FAMILIES`
    errors:      (targets,) by metric, infinite for a material that it could not be fitted to
    floats:      numbers stored per material
    fit_seconds: of all materials
    cost_ns:     per evaluation, the median of the materials; it and `floats` are 0 where no fit succeeded
    warnings:    each begins with a material's name; why a fit failed comes first
    """

    kind: str
    errors: dict[str, tuple[float, ...]]
    floats: int
    fit_seconds: float
    cost_ns: float
    warnings: tuple[str, ...]

    @classmethod
    def of(cls, name: str, judged: Sequence[Judged]) -> "TabulatedBaseline":
        """The baseline of a name, of its fits to every material in their order."""
        failed_first = sorted(judged, key=lambda one: one.floats > 0)
        return cls(
            kind=FAMILIES[name],
            errors={metric: tuple(e for one in judged for e in one.errors[metric]) for metric in judged[0].errors},
            floats=max(one.floats for one in judged),
            fit_seconds=sum(one.fit_seconds for one in judged),
            cost_ns=median([one.cost_ns for one in judged if one.floats] or [0.0]),
            warnings=tuple(warning for one in failed_first for warning in one.warnings),
        )

    @property
    def metrics(self) -> dict[str, float]:
        """The error over all targets by every metric."""
        return {name: RESIDUALS[name].combine(np.array(errors)) for name, errors in self.errors.items()}


Baseline = FormulaBaseline | TabulatedBaseline
