"""A picture: linear radiance in the pixels that show the object."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fitters.errors import FittersError
from fitters.grid import Array


@dataclass(frozen=True, eq=False)
class Picture:
    """Linear radiance of an object against black.

    `pixels` (h, w, 3) float64, RGB of the light's own primaries (taken for those of BT.709), row 0 at the top,
    0 outside `foreground` (h, w) bool. Raises `FittersError` unless shapes and types fit, every pixel is finite
    and some belong to the foreground.
    """

    pixels: Array
    foreground: NDArray[np.bool_]

    def __post_init__(self) -> None:
        shape = self.pixels.shape
        if len(shape) != 3 or shape[2] != 3 or self.pixels.dtype != np.float64:
            raise FittersError(f"picture: pixels are float64 (h, w, 3), not {self.pixels.dtype} {shape}")
        if self.foreground.shape != shape[:2] or self.foreground.dtype != np.bool_:
            raise FittersError(
                f"picture: a foreground is bool {shape[:2]}, not {self.foreground.dtype} {self.foreground.shape}"
            )
        if not self.foreground.any():
            raise FittersError("picture: no pixel shows the object")
        wrong = int(np.count_nonzero(~np.isfinite(self.pixels)))
        if wrong:
            raise FittersError(f"picture: {wrong} values are NaN or infinite; the model is not finite everywhere")
        if np.any(self.pixels[~self.foreground]):
            raise FittersError("picture: some pixels outside the foreground are not 0")
