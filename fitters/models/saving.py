"""Models as `.npz` files: their arrays under the papers' names, and what kind of model they are."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from fitters.errors import FittersError
from fitters.models.model import Model

FOREIGN = "holds no model that `gpsearch fit --save` wrote, or was cut short: fit and save it again."


def save(model: Model, path: Path) -> None:
    """Writes a model; `path` ends in `.npz`. Raises `FittersError` where it cannot be written."""
    try:
        with path.open("wb") as file:
            content = {"kind": np.array(model.kind), "fit_seconds": np.array(model.fit_seconds), **model.arrays()}
            np.savez_compressed(file, **content)  # type: ignore[arg-type]
    except OSError as error:
        raise FittersError(f"{path} cannot be written: {error.strerror or error}.") from error


def load(path: Path, kinds: Mapping[str, type[Model]]) -> Model:
    """The model in a file that `save` wrote, one of `kinds`. Raises `FittersError` for any other file."""
    arrays = _arrays(path)
    try:
        kind, seconds = str(arrays.pop("kind")), float(arrays.pop("fit_seconds"))
    except (KeyError, TypeError, ValueError) as error:
        raise FittersError(f"{path} {FOREIGN}") from error
    if kind not in kinds:
        raise FittersError(
            f"{path} holds a model of kind {kind!r}; known are {', '.join(kinds)}. Read it with the version that "
            "wrote it, or fit and save it again."
        )
    try:
        model = kinds[kind].from_arrays(arrays)
    except Exception as error:
        # Arrays that are missing, or of shapes and values that the model refuses.
        raise FittersError(
            f"{path} does not hold the arrays of {kind} ({error}): fit and save it again."
        ) from error
    model.fit_seconds = seconds
    return model


def _arrays(path: Path) -> dict[str, np.ndarray]:
    try:
        # Pickles are code that runs on loading: an array of objects is refused.
        with np.load(path, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except FileNotFoundError as error:
        raise FittersError(f"{path} does not exist: check the path.") from error
    except (IsADirectoryError, PermissionError) as error:
        raise FittersError(f"{path} cannot be read ({error.strerror}): name a file that can.") from error
    except Exception as error:
        # A torn or foreign file: np.load raises many kinds (zipfile, zlib, value, key, OS errors).
        raise FittersError(f"{path} {FOREIGN}") from error
