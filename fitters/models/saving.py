"""Models as `.npz` files: their arrays under the papers' names, and what kind of model they are."""

from pathlib import Path

import numpy as np

from fitters.errors import FittersError
from fitters.models.model import Model


def save(model: Model, path: Path) -> None:
    """Writes a model; `path` ends in `.npz`. Raises `FittersError` where it cannot be written."""
    try:
        with path.open("wb") as file:
            content = {"kind": np.array(model.kind), "fit_seconds": np.array(model.fit_seconds), **model.arrays()}
            np.savez_compressed(file, **content)  # type: ignore[arg-type]
    except OSError as error:
        raise FittersError(f"{path} cannot be written: {error.strerror or error}.") from error


def load(path: Path, kinds: dict[str, type[Model]]) -> Model:
    """The model in a file that `save` wrote, one of `kinds`. Raises `FittersError` for any other file."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
        kind, seconds = str(arrays.pop("kind")), float(arrays.pop("fit_seconds"))
        model = kinds[kind].from_arrays(arrays)
    except FileNotFoundError as error:
        raise FittersError(f"{path} does not exist: check the path.") from error
    except Exception as error:
        # A torn or foreign file: np.load raises many kinds (zipfile, zlib, value, key, OS errors).
        raise FittersError(f"{path} holds no model that `gpsearch fit --save` wrote: save it again.") from error
    model.fit_seconds = seconds
    return model
