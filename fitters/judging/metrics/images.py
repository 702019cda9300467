"""How far the picture of a model is from that of the measurement, the truth.

All metrics look at the foreground only and take the exposure, where they need one, from the truth only, so that
neither the size of the background nor the scale of the light changes a value.
"""

import functools
import math
import warnings
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass
from typing import Any

import numpy as np

from fitters.errors import FittersError
from fitters.grid import Array
from fitters.judging.metrics.contract import Compared, Comparison, Metric
from fitters.rendering.picture import ABSOLUTE_PROTOCOL, PROTOCOL, Picture, absolute, displayed, exposure

PEAK = 10000.0
"""cd/m^2 at which the transfer function of SMPTE ST 2084 ends."""

SSIM_RADIUS, SSIM_SIGMA = 5, 1.5
"""The 11 x 11 Gaussian window of Wang et al. 2004."""

PIXELS_PER_DEGREE = 67.0
"""Of FLIP's observer: a display of 3840 pixels, 0.7 m wide, seen from 0.7 m (Andersson et al. 2020)."""

FLIP_RADIUS = 10
"""Pixels that FLIP's widest filter reaches, at `PIXELS_PER_DEGREE`."""


@dataclass(frozen=True)
class ImageMetric(Metric):
    """A distance (or likeness) of two pictures; `compare` checks them before it calls `between(truth, model)`."""

    _: KW_ONLY
    between: Callable[[Picture, Picture], Comparison]

    def compare(self, truth: Picture, model: Picture) -> Comparison:
        """Raises `FittersError` where the pictures differ in shape or foreground, or the truth is black."""
        if not np.array_equal(truth.foreground, model.foreground):
            raise FittersError("pictures of different foregrounds cannot be compared: render both in one scene")
        if not truth.pixels.any():
            raise FittersError("the true picture is black: no light reaches what is seen; rotate the light")
        return self.between(truth, model)

    def measure(self, compared: Compared) -> Comparison:
        if compared.truth is None or compared.picture is None:
            raise FittersError(f"{compared.material.name}: {self.name} compares pictures, and none were rendered")
        return self.compare(compared.truth, compared.picture)


def psnr(truth: Array, model: Array) -> float:
    """Peak signal-to-noise ratio in dB of linear pixels (n, 3); infinite for equal ones.

    The peak is the largest value of the truth (Bagher et al. 2016, section 5).
    """
    mean_square = float(np.mean((model - truth) ** 2))
    return math.inf if mean_square == 0 else 10 * math.log10(float(truth.max()) ** 2 / mean_square)


def _l2(truth: Picture, model: Picture) -> Comparison:
    scale = float(np.linalg.norm(truth.pixels))
    distance = np.linalg.norm(model.pixels - truth.pixels, axis=-1) / scale
    return Comparison(float(np.linalg.norm(distance)), distance)


def _psnr(truth: Picture, model: Picture) -> Comparison:
    seen = truth.foreground
    peak = float(truth.pixels[seen].max())
    square = np.mean((model.pixels - truth.pixels) ** 2, axis=-1) / peak**2
    return Comparison(psnr(truth.pixels[seen], model.pixels[seen]), square)


def _dissimilarity(truth: Picture, model: Picture) -> Comparison:
    from skimage.metrics import structural_similarity

    first, second = (_padded(shown, SSIM_RADIUS) for shown in _shown(truth, model))
    _, similarity = structural_similarity(
        first,
        second,
        gaussian_weights=True,
        sigma=SSIM_SIGMA,
        use_sample_covariance=False,
        data_range=1.0,
        channel_axis=-1,
        full=True,
    )
    return _averaged(1 - _cropped(similarity, SSIM_RADIUS).mean(axis=-1), truth)


def _delta_e_2000(truth: Picture, model: Picture) -> Comparison:
    first, second = (shown[truth.foreground] for shown in _shown(truth, model))
    return _averaged(_spread(delta_e_2000(first, second), truth), truth)


def _delta_e_itp(truth: Picture, model: Picture) -> Comparison:
    scale = exposure(truth)
    first, second = (absolute(picture, scale)[truth.foreground] for picture in (truth, model))
    return _averaged(_spread(delta_e_itp(first, second), truth), truth)


def _flip(truth: Picture, model: Picture) -> Comparison:
    import flip_evaluator

    first, second = (_padded(shown, FLIP_RADIUS).astype(np.float32) for shown in _shown(truth, model))
    errors, _, _ = flip_evaluator.evaluate(
        first,
        second,
        "LDR",
        inputsRGB=True,
        applyMagma=False,
        computeMeanError=False,
        parameters={"ppd": PIXELS_PER_DEGREE},
    )
    return _averaged(_cropped(errors, FLIP_RADIUS)[..., 0].astype(np.float64), truth)


def _shown(truth: Picture, model: Picture) -> tuple[Array, Array]:
    scale = exposure(truth)
    return displayed(truth, scale), displayed(model, scale)


def _averaged(errors: Array, truth: Picture) -> Comparison:
    """The mean of errors (h, w) over the foreground; errors that a filter spreads outside are left out."""
    return Comparison(float(np.mean(errors[truth.foreground])), np.where(truth.foreground, errors, 0.0))


def _spread(values: Array, truth: Picture) -> Array:
    """Values (n,) of the foreground's pixels as an image (h, w)."""
    image = np.zeros(truth.foreground.shape)
    image[truth.foreground] = values
    return image


def _padded(image: Array, radius: int) -> Array:
    # At the edge of an image a filter would repeat the image; a black border is what it sees elsewhere around the
    # object.
    return np.pad(image, ((radius, radius), (radius, radius), (0, 0)))


def _cropped(image: Array, radius: int) -> Array:
    return image[radius:-radius, radius:-radius]


def delta_e_2000(truth: Array, model: Array) -> Array:
    """CIEDE2000 (n,) between sRGB colours (n, 3) in [0, 1], through CIELAB for D65 and the 2 degree observer."""
    colour = _colour_science()
    first, second = (colour.XYZ_to_Lab(colour.sRGB_to_XYZ(shown)) for shown in (truth, model))
    return lab_difference(first, second)


def lab_difference(truth: Array, model: Array) -> Array:
    """CIEDE2000 (n,) between CIELAB colours (n, 3), all weights 1."""
    return np.asarray(_colour_science().delta_E(truth, model, method="CIE 2000"))


def delta_e_itp(truth: Array, model: Array) -> Array:
    """Delta E ITP (n,) after BT.2124 between display lights (n, 3) in cd/m^2 of BT.709 primaries."""
    first, second = (ictcp(light) for light in (truth, model))
    return np.asarray(_colour_science().delta_E(first, second, method="ITP"))


def ictcp(light: Array) -> Array:
    """ICtCp (n, 3) of BT.2100, PQ, of display light (n, 3) in cd/m^2 of BT.709 primaries, clipped at the peak."""
    colour = _colour_science()
    wide = light @ colour.matrix_RGB_to_RGB("ITU-R BT.709", "ITU-R BT.2020", chromatic_adaptation_transform=None).T
    return colour.RGB_to_ICtCp(np.clip(wide, 0.0, PEAK))


@functools.cache
def _colour_science() -> Any:
    """The library, imported where it is first used: it takes seconds, and warns of optional packages."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import colour
    return colour


_LINEAR = "linear RGB, no exposure, foreground pixels only"
_DISPLAYED = f"displayed sRGB ({PROTOCOL})"
_BORDER = "windows at the silhouette see black background"

METRICS: tuple[Metric, ...] = (
    ImageMetric(
        "l2",
        "image",
        "|| I - J || / || J || over pixels and channels, J the truth: the L^2 error in RGB of Brady et al. 2014, "
        f"relative to the truth; {_LINEAR}",
        label="image L2",
        between=_l2,
    ),
    ImageMetric(
        "psnr",
        "image",
        "10 log10(peak^2 / mean square error), the peak being the largest component of the truth's foreground "
        f"(Bagher et al. 2016, section 5); infinite for equal pictures; {_LINEAR}",
        unit="dB",
        better="higher",
        label="PSNR",
        between=_psnr,
    ),
    ImageMetric(
        "1-ssim",
        "image",
        "1 - SSIM (Wang et al. 2004; scikit-image: 11 x 11 Gaussian window of sigma 1.5, K1 0.01, K2 0.03, range "
        f"1), the mean over R, G, B and foreground pixels; {_BORDER}; {_DISPLAYED}",
        label="1 - SSIM",
        between=_dissimilarity,
    ),
    ImageMetric(
        "delta-e-2000",
        "image",
        "CIEDE2000, weights 1 (colour-science), the mean over foreground pixels; CIELAB, D65, 2 degree observer, "
        f"of {_DISPLAYED}",
        unit="CIEDE2000",
        label="CIEDE2000",
        short="dE 2000",
        between=_delta_e_2000,
    ),
    ImageMetric(
        "delta-e-itp",
        "image",
        "Delta E ITP of BT.2124 (colour-science), 1 being just noticeable, the mean over foreground pixels; ICtCp "
        f"of BT.2100 PQ, clipped to {PEAK:,.0f} cd/m^2; {ABSOLUTE_PROTOCOL}",
        unit="Delta E ITP",
        label="Delta E ITP",
        short="dE ITP",
        between=_delta_e_itp,
    ),
    ImageMetric(
        "flip",
        "image",
        f"LDR-FLIP (Andersson et al. 2020; flip-evaluator) at {PIXELS_PER_DEGREE:g} pixels per degree, the mean "
        f"of its error map over foreground pixels, 0 to 1; {_BORDER}; {_DISPLAYED}",
        label="FLIP",
        between=_flip,
    ),
)
"""The metrics of the papers first. No single one ranks models as people do."""
