"""What a fit leaves, whatever was fitted: a model of each material, its errors, and what to know of them."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from fitters.errors import FittersError
from fitters.grid import Array
from fitters.models.model import Model

PerChannel = tuple[float, float, float]
Kinds = Mapping[str, type[Model]]
"""Classes of models by their `kind`."""

FOREIGN = "holds no model that was fitted and saved here, or was cut short: fit and save it again."


@dataclass(frozen=True, eq=False)
class MaterialFit:
    """A model fitted to one material.

    details:  what only this kind of model reports, as plain objects (text, numbers, lists, dictionaries)
    remarks:  for people, one for each channel; `notes` are those about all channels together
    warnings: sentences that say where the fit is not to be relied on
    """

    model: Model
    warnings: tuple[str, ...] = ()
    details: Mapping[str, Any] = field(default_factory=dict)
    remarks: tuple[str, str, str] = ("", "", "")
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Fitted:
    """A model fitted to the materials of a problem, as `fitters.fit` and `fitters.load` return it.

        fitted = fitters.fit("ggx", problem)
        fitted.evaluate(wi, wo)             # of a single material; of several, fitted["steel"].evaluate(wi, wo)

    name:        of the model, as it was asked for
    fits:        by the material's name
    errors:      by the material's name, of the three channels, by the problem's metric
    metrics:     the error over all materials and channels by every metric
    fit_seconds: of all materials
    warnings:    sentences that say where the fit is not to be relied on; none is a good sign, not a proof
    """

    name: str
    fits: Mapping[str, MaterialFit]
    metric: str
    errors: Mapping[str, PerChannel]
    metrics: Mapping[str, float]
    fit_seconds: float
    warnings: tuple[str, ...] = ()

    def __repr__(self) -> str:
        known = f"{self.metric} error {self.error:.4g}" if self.metric else "errors unknown"
        warned = f", {len(self.warnings)} warnings" if self.warnings else ""
        return f"Fitted({self.name!r} to {', '.join(self.materials)}: {known}, {self.floats} floats{warned})"

    def __getitem__(self, material: str) -> Model:
        """The model of one material, by its name."""
        if material not in self.fits:
            raise FittersError(f"{self.name} is not fitted to {material!r}: there is {', '.join(self.fits)}")
        return self.fits[material].model

    @property
    def materials(self) -> tuple[str, ...]:
        """Names of the materials."""
        return tuple(self.fits)

    @property
    def model(self) -> Model:
        """The model of the one material. Raises `FittersError` where there are several."""
        if len(self.fits) > 1:
            first = self.materials[0]
            raise FittersError(
                f'{self.name} is fitted to {len(self.fits)} materials: choose one, fitted["{first}"]'
            )
        return self[self.materials[0]]

    @property
    def error(self) -> float:
        """By the problem's metric, over all materials and channels."""
        if not self.metric:
            raise FittersError(
                f"{self.name} was read from a file that does not say its error: fit and save it again"
            )
        return self.metrics[self.metric]

    @property
    def floats(self) -> int:
        """Numbers to store for one material, all three channels."""
        return self[self.materials[0]].floats

    @property
    def parameters(self) -> dict[str, dict[str, PerChannel]]:
        """Of a formula: by parameter, `p0`.., and by the material's name, of the three channels; else empty."""
        named = {name: fit.model.named_parameters for name, fit in self.fits.items()}
        symbols = next(iter(named.values()))
        return {symbol: {name: values[symbol] for name, values in named.items()} for symbol in symbols}

    @cached_property
    def cost(self) -> float:
        """Nanoseconds per evaluation of a channel, measured once on this machine; see `Model.cost_ns`."""
        return self[self.materials[0]].cost_ns()

    def evaluate(self, w_i: Array, w_o: Array) -> Array:
        """BRDF values (n, 3) in sr^-1 of the one material, for unit directions (n, 3); the normal is +z."""
        return self.model.evaluate(w_i, w_o)

    def sample(self, w_o: Array, u: Array) -> Array:
        """Directions w_i (n, 3) for views (n, 3) and uniform numbers (n, 3) in [0, 1)."""
        return self.model.sample(w_o, u)

    def pdf(self, w_i: Array, w_o: Array) -> Array:
        """The density (n,), sr^-1, with which `sample` returns w_i."""
        return self.model.pdf(w_i, w_o)

    def save(self, path: str | Path) -> None:
        """Writes a `.npz` file that `fitters.load` reads. Raises `FittersError` where that cannot be written.

        The arrays of a single material stand under the papers' names; those of several have the number of their
        material and a point before them.
        """
        report = {
            "name": self.name,
            "metric": self.metric,
            "errors": {name: list(errors) for name, errors in self.errors.items()},
            "metrics": dict(self.metrics),
            "fit_seconds": self.fit_seconds,
            "warnings": list(self.warnings),
            "fits": [
                {
                    "material": name,
                    "warnings": fit.warnings,
                    "details": fit.details,
                    "notes": [fit.remarks, fit.notes],
                }
                for name, fit in self.fits.items()
            ],
        }
        content: dict[str, np.ndarray] = {"fitted": np.array(json.dumps(report))}
        for number, fit in enumerate(self.fits.values()):
            before = f"{number}." if len(self.fits) > 1 else ""
            content |= {before + name: values for name, values in arrays_of(fit.model).items()}
        try:
            with Path(path).open("wb") as file:
                np.savez_compressed(file, **content)  # type: ignore[arg-type]
        except OSError as error:
            raise FittersError(f"{path} cannot be written: {error.strerror or error}.") from error


def arrays_of(model: Model) -> dict[str, np.ndarray]:
    """All that a model is, as arrays: those of `Model.arrays`, its kind and its seconds."""
    return {"kind": np.array(model.kind), "fit_seconds": np.array(model.fit_seconds), **model.arrays()}


def model_of(arrays: Mapping[str, np.ndarray], kinds: Kinds) -> Model:
    """The model that `arrays_of` took apart.

    Raises `KeyError` or `TypeError` or `ValueError` for arrays of anything else.
    """
    given = dict(arrays)
    kind, seconds = str(given.pop("kind")), float(given.pop("fit_seconds"))
    model = kinds[kind].from_arrays(given)
    model.fit_seconds = seconds
    return model


def read(path: Path, kinds: Kinds) -> Fitted:
    """What `Fitted.save` wrote, of models of these kinds. Raises `FittersError` for any other file."""
    arrays = _stored(path)
    try:
        report = json.loads(str(arrays.pop("fitted"))) if "fitted" in arrays else _unknown(path, arrays)
        parts = [_part(arrays, number, len(report["fits"])) for number in range(len(report["fits"]))]
        held = [str(part["kind"]) for part in parts if float(part["fit_seconds"]) >= 0]
    except (KeyError, TypeError, ValueError) as error:
        raise FittersError(f"{path} {FOREIGN}") from error
    for kind in held:
        if kind not in kinds:
            raise FittersError(
                f"{path} holds a model of kind {kind!r}; known are {', '.join(kinds)}. Read it with the version "
                "that wrote it, or fit and save it again."
            )
    try:
        return _fitted(report, [model_of(part, kinds) for part in parts])
    except Exception as error:
        # Arrays that are missing, or of shapes and values that the model refuses.
        raise FittersError(
            f"{path} does not hold the arrays of {', '.join(held)} ({error}): fit and save it again."
        ) from error


def _fitted(report: Mapping[str, Any], models: Sequence[Model]) -> Fitted:
    fits = {}
    for model, kept in zip(models, report["fits"], strict=True):
        remarks, notes = kept["notes"]
        fits[kept["material"]] = MaterialFit(
            model, tuple(kept["warnings"]), kept["details"], tuple(remarks), tuple(notes)
        )
    return Fitted(
        name=report["name"],
        fits=fits,
        metric=report["metric"],
        errors={name: (r, g, b) for name, (r, g, b) in report["errors"].items()},
        metrics=report["metrics"],
        fit_seconds=report["fit_seconds"],
        warnings=tuple(report["warnings"]),
    )


def _unknown(path: Path, arrays: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """The report of a file that holds one model and nothing else, as gpsearch 0.1 wrote it."""
    fit = {"material": path.stem, "warnings": (), "details": {}, "notes": [("", "", ""), ()]}
    report = {
        "name": str(arrays["kind"]),
        "metric": "",
        "errors": {},
        "metrics": {},
        "warnings": (),
        "fits": [fit],
    }
    return report | {"fit_seconds": float(arrays["fit_seconds"])}


def _part(arrays: Mapping[str, np.ndarray], number: int, count: int) -> dict[str, np.ndarray]:
    """The arrays of one of `count` models."""
    if count == 1:
        return dict(arrays)
    before = f"{number}."
    return {name.removeprefix(before): values for name, values in arrays.items() if name.startswith(before)}


def _stored(path: Path) -> dict[str, np.ndarray]:
    try:
        # Pickles are code that runs on loading: an array of objects is refused.
        with np.load(path, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except FileNotFoundError as error:
        raise FittersError(f"{path} does not exist: check the path.") from error
    except (IsADirectoryError, PermissionError) as error:
        raise FittersError(f"{path} cannot be read ({error.strerror}): name a file that can.") from error
    except Exception as error:
        # An incomplete or foreign file: np.load raises many kinds (zipfile, zlib, value, key, OS errors).
        raise FittersError(f"{path} {FOREIGN}") from error
