"""An image of linear radiance with the pixels that show the surface."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fitters.errors import FittersError
from fitters.grid import Array


@dataclass(frozen=True, eq=False)
class Picture:
    """`pixels` (h, w, 3) float64, linear RGB radiance, row 0 at the top; 0 outside `foreground` (h, w)."""

    pixels: Array
    foreground: NDArray[np.bool_]

    def __post_init__(self) -> None:
        if self.pixels.shape != (*self.foreground.shape, 3):
            raise FittersError(f"picture: pixels {self.pixels.shape} for a foreground {self.foreground.shape}")
        if not self.foreground.any():
            raise FittersError("picture: no pixel shows the surface")
