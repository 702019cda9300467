"""The accuracy card of a model of a material in a scene: its metrics, and where in the image it is worst."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.ndimage import gaussian_filter

from fitters.errors import FittersError
from fitters.grid import CELLS, SHAPE, Array, cell_directions
from fitters.judging.metrics import CARD_METRICS, IMAGE_METRICS, Compared
from fitters.materials import Material
from fitters.models import Model
from fitters.rendering.maps import ImageMap
from fitters.rendering.picture import Picture
from fitters.scenes import LightTable

WORST_BY = "flip"
"""The metric whose error map says where a picture is worst."""

REGION = 1 / 24
"""Standard deviation of the Gaussian window of a region, as a share of the image's height."""


@dataclass(frozen=True)
class Region:
    """The worst region of a picture: row and column of its centre (0 at the top left), the angle (degrees) between
    normal and view there, its FLIP error, and the mean linear colours around it, of the truth and of the model.
    """

    row: int
    column: int
    facing: float
    error: float
    truth: tuple[float, float, float]
    model: tuple[float, float, float]


@dataclass(frozen=True)
class Card:
    """The values of `CARD_METRICS` for a model of one material; the PSNR of equal pictures is infinite.

    `unmeasured` is `Judge.unmeasured`.
    """

    metrics: dict[str, float]
    worst: Region
    unmeasured: float


@dataclass(frozen=True, eq=False)
class Judge:
    """A material in a scene, of which the image map and the light table are given."""

    image: ImageMap
    light: LightTable
    material: Material

    @cached_property
    def truth(self) -> Picture:
        """The picture of the measurement."""
        return self.image.of_material(self.material)

    @cached_property
    def unmeasured(self) -> float:
        """The share of a white surface's light in cells without a measurement: black in every picture."""
        return self.image.unmeasured(self.material)

    def card(self, model: Model) -> tuple[Card, Picture]:
        """The card of a model of the material, and its picture.

        Raises `FittersError` where the truth is black, or the model not finite.
        """
        values = model_values(model, self.material)
        picture = self.image.picture(values[:, self.image.cells].T)
        compared = Compared(self.material, self.light, values.reshape(3, *SHAPE), self.truth, picture)
        comparisons = {name: metric.measure(compared) for name, metric in CARD_METRICS.items()}
        metrics = {name: comparison.value for name, comparison in comparisons.items()}
        errors_seen = comparisons[WORST_BY].per_pixel
        assert errors_seen is not None
        worst = self._worst(errors_seen, picture)
        return Card(metrics, worst, self.unmeasured), picture

    def _worst(self, errors: Array, model: Picture) -> Region:
        """Where the errors (h, w), averaged over a region of the foreground, are largest."""
        truth = self.truth
        seen = truth.foreground.astype(np.float64)
        sigma = max(REGION * len(errors), 1.0)
        share = np.maximum(gaussian_filter(seen, sigma), 1e-12)
        mean = np.where(truth.foreground, gaussian_filter(errors, sigma) / share, 0.0)
        row, column = (int(i) for i in np.unravel_index(np.argmax(mean), mean.shape))
        facing = np.zeros(errors.shape)
        facing.ravel()[self.image.pixels] = self.image.facing

        def colour(picture: Picture) -> tuple[float, float, float]:
            r, g, b = (gaussian_filter(picture.pixels[..., c], sigma)[row, column] for c in range(3))
            return float(r / share[row, column]), float(g / share[row, column]), float(b / share[row, column])

        angle = float(np.degrees(np.arccos(np.clip(facing[row, column], 0.0, 1.0))))
        return Region(row, column, angle, float(mean[row, column]), colour(truth), colour(model))


def model_values(model: Model, material: Material) -> Array:
    """Values (3, cells) float32 of a model, sr^-1, 0 in cells where the material was not measured.

    Raises `FittersError` where the model is not finite.
    """
    index = np.flatnonzero(material.valid)
    w_i, w_o = cell_directions()
    values = np.zeros((3, CELLS), np.float32)
    with np.errstate(over="ignore"):
        values[:, index] = model.evaluate(w_i[index], w_o[index]).T
    if not np.isfinite(values).all():
        raise FittersError(f"{material.name}: a {model.kind} model is not finite on all measured cells")
    return values


def error_map(truth: Picture, model: Picture) -> Array:
    """The FLIP error (h, w) of every pixel, 0 to 1."""
    per_pixel = IMAGE_METRICS[WORST_BY].compare(truth, model).per_pixel
    assert per_pixel is not None
    return per_pixel
