"""Fits models of reflectance to measured materials in a scene.

    material = fitters.load_material("steel.binary")
    problem = fitters.Problem([material], fitters.Scene("grace.hdr"), metric="light")
    fitted = fitters.fit("ggx", problem)
    fitted.evaluate(wi, wo), fitted.error, fitted.warnings

`fitters/README.md` has more examples. Names are loaded when they are first used: the import itself costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from fitters.errors import FittersError

if TYPE_CHECKING:
    from fitters.expressions import Expression, parse
    from fitters.fitting.problem import Problem
    from fitters.judging.metrics import METRICS
    from fitters.materials import Material, load_anisotropic, load_material
    from fitters.models import MODELS, Fitted, Model, fit, load
    from fitters.scenes import Scene

_HOMES = {
    "fitters.expressions": ("Expression", "parse"),
    "fitters.fitting.problem": ("Problem",),
    "fitters.judging.metrics": ("METRICS",),
    "fitters.materials": ("Material", "load_anisotropic", "load_material"),
    "fitters.models": ("MODELS", "Fitted", "Model", "fit", "load"),
    "fitters.scenes": ("Scene",),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}

__all__ = [
    "METRICS",
    "MODELS",
    "Expression",
    "Fitted",
    "FittersError",
    "Material",
    "Model",
    "Problem",
    "Scene",
    "fit",
    "load",
    "load_anisotropic",
    "load_material",
    "parse",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
