"""Fitted baselines, kept on disk: the tables that a run reported are there for whoever judges it later."""

from pathlib import Path
from typing import Any

import numpy as np

from fitters import cache, materials
from fitters.materials import Material
from fitters.models import factors, power_iterations
from fitters.models.baselines.fitted import Fitted
from fitters.models.baselines.names import KINDS, fit_baseline


def kept_baseline(name: str, material: Material) -> Fitted:
    """The baseline of a name fitted to a material, without its details, fitted once on a machine.

    Kept by the samples of the material and of the code that fits. Raises `FittersError` as `fit_baseline` does.
    """

    def build() -> dict[str, np.ndarray]:
        fitted = fit_baseline(name, material)
        model = fitted.model
        return {
            "kind": np.array(model.kind),
            "fit_seconds": np.array(model.fit_seconds),
            "warnings": np.array(fitted.warnings, np.str_),
            **{f"model.{key}": values for key, values in model.arrays().items()},
        }

    stored = cache.arrays("baseline", _key(name, material), build)
    return _fitted(stored)


def _fitted(stored: dict[str, Any]) -> Fitted:
    arrays = {key.removeprefix("model."): values for key, values in stored.items() if key.startswith("model.")}
    model = KINDS[str(stored["kind"])].from_arrays(arrays)
    model.fit_seconds = float(stored["fit_seconds"])
    return Fitted(model, warnings=tuple(map(str, stored["warnings"])))


def _key(name: str, material: Material) -> str:
    return cache.digest(name, material.name, material.table, material.valid, material.doubts, _code())


def _code() -> str:
    """What reads and fits: a mended fit is not answered with what was found before."""
    return cache.of_code(*(Path(package.__path__[0]) for package in (materials, factors, power_iterations)))
