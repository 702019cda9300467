"""Measurements that went wrong: directions that are missing or in shadow, samples that are wrong."""

import numpy as np
from numpy.typing import NDArray

from fitters.grid import SHAPE, cell_directions
from fitters.stability.case import Base, Case, Hazard, disturbed, samples_of

NEAR_DEGREES = 5
"""Up to this theta_diff, light source and detector hide each other."""
DEEPEST = 0.15
"""The share of light straight back that the detector measures where its shadow is deepest."""
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
    """(90, 90, 180): cells in which a direction lies further than `degrees` from the normal."""
    w_i, w_o = cell_directions()
    lowest = np.minimum(w_i[:, 2], w_o[:, 2])
    return np.asarray(lowest < np.cos(np.radians(degrees))).reshape(SHAPE)


def _grazing(base: Base, level: int, seed: int) -> Case:
    samples, outside = samples_of(base.material), beyond(GRAZING_DEGREES)
    if level == 0:
        samples[:, outside] = np.nan
        return disturbed(base, "grazing missing", samples)
    # Every row over theta_diff is continued with the last value that was measured in it.
    last = np.maximum.accumulate(np.where(outside, 0, np.arange(SHAPE[1])[None, :, None]), axis=1)
    held = np.take_along_axis(samples, np.broadcast_to(last, samples.shape), axis=2)
    unknown = outside & np.isfinite(samples[0])
    samples[:, unknown] = held[:, unknown]
    # Rows that begin outside have no such value.
    first = np.broadcast_to(outside[:, :1], SHAPE)
    samples[:, first & outside] = np.nan
    return disturbed(base, "grazing extrapolated", samples)


NOISE = (0.01, 0.05, 0.10, 0.20)
"""Standard deviations of the noise, relative to each sample."""
SPIKES = (1e-4, 1e-3)
SPIKE = 1000.0
DROPPED = 0.2
OFFSET = 0.5


def _noise(base: Base, level: int, seed: int) -> Case:
    samples, random = samples_of(base.material), np.random.default_rng((seed, 2))
    factor = 1 + NOISE[level] * random.standard_normal(samples.shape, np.float32)
    return disturbed(base, f"noise {NOISE[level]:.0%}", samples * factor.astype(np.float32))


def _fireflies(base: Base, level: int, seed: int) -> Case:
    samples, random = samples_of(base.material), np.random.default_rng((seed, 3))
    samples[:, random.random(SHAPE, np.float32) < SPIKES[level]] *= np.float32(SPIKE)
    return disturbed(base, f"fireflies {SPIKES[level]:g}", samples)


def _below_zero(base: Base, level: int, seed: int) -> Case:
    samples, random = samples_of(base.material), np.random.default_rng((seed, 4))
    if level == 0:
        middle = np.nanmedian(samples, axis=(1, 2, 3), keepdims=True)
        samples += OFFSET * middle * random.standard_normal(samples.shape, np.float32)
        return disturbed(base, "negative samples", samples)
    lost = random.random(SHAPE, np.float32) < DROPPED
    return disturbed(base, "zero samples", np.where(lost, np.float32(0) * samples, samples))


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
    Hazard(
        "noise",
        "normal noise relative to each sample, independent in each channel",
        tuple(f"{share:.0%}" for share in NOISE),
        _noise,
        random=True,
    ),
    Hazard(
        "fireflies",
        f"a share of the cells is {SPIKE:g} times too bright",
        tuple(f"{share:g}" for share in SPIKES),
        _fireflies,
        random=True,
    ),
    Hazard(
        "zeros",
        f"dark noise of {OFFSET:g} medians makes samples negative; or {DROPPED:.0%} of the samples are zero",
        ("negative", "zero"),
        _below_zero,
        random=True,
    ),
)
