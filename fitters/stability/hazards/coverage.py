"""Directions that were measured badly or not at all: backscattering and grazing angles."""

import numpy as np
from numpy.typing import NDArray

from fitters.grid import SHAPE, cell_directions
from fitters.stability.case import Base, Case, disturbed, samples_of
from fitters.stability.hazards.hazard import Hazard

NEAR_DEGREES = 5
"""Up to this theta_diff, light source and detector stand in each other's way."""
DEEPEST = 0.15
"""Of the light that comes straight back, so much is seen past the detector."""
GRAZING_DEGREES = 60.0


def _backscattering(base: Base, level: int, seed: int) -> Case:
    samples = samples_of(base.material)
    if level == 1:
        samples[:, :, :NEAR_DEGREES] = np.nan
        return disturbed(base, "no backscattering", samples)
    # The detector's shadow moves as the sample is turned: its depth differs from one theta_half to the next.
    depth = np.random.default_rng((seed, 1)).uniform(DEEPEST, 1.0, (SHAPE[0], 1, 1))
    shadow = np.clip(np.arange(NEAR_DEGREES) / NEAR_DEGREES, 0, 1)[None, :, None]
    samples[:, :, :NEAR_DEGREES] *= (depth + (1 - depth) * shadow).astype(np.float32)
    return disturbed(base, "poor backscattering", samples)


def beyond(degrees: float) -> NDArray[np.bool_]:
    """(90, 90, 180): cells in which a direction lies further than so many degrees from the normal."""
    w_i, w_o = cell_directions()
    lowest = np.minimum(w_i[:, 2], w_o[:, 2])
    return np.asarray(lowest < np.cos(np.radians(degrees))).reshape(SHAPE)


def _grazing(base: Base, level: int, seed: int) -> Case:
    samples, outside = samples_of(base.material), beyond(GRAZING_DEGREES)
    if level == 0:
        samples[:, outside] = np.nan
        return disturbed(base, "grazing missing", samples)
    # Every row over theta_diff goes on with the last value that was measured in it.
    last = np.maximum.accumulate(np.where(outside, 0, np.arange(SHAPE[1])[None, :, None]), axis=1)
    held = np.take_along_axis(samples, np.broadcast_to(last, samples.shape), axis=2)
    unknown = outside & np.isfinite(samples[0])
    samples[:, unknown] = held[:, unknown]
    # Rows that begin beyond have no value to go on with.
    first = np.broadcast_to(outside[:, :1], SHAPE)
    samples[:, first & outside] = np.nan
    return disturbed(base, "grazing extrapolated", samples)


HAZARDS = (
    Hazard(
        "backscattering",
        f"within {NEAR_DEGREES} degrees of straight back the measurement is in shadow, or is not there",
        ("poor", "missing"),
        _backscattering,
        random=True,
    ),
    Hazard(
        "grazing",
        f"beyond {GRAZING_DEGREES:.0f} degrees nothing was measured; or the file holds the last value instead",
        ("missing", "extrapolated"),
        _grazing,
    ),
)
