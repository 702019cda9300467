"""Samples that are wrong: noise, isolated spikes, values that are zero or below."""

import numpy as np

from fitters.grid import SHAPE
from fitters.stability.case import Base, Case, disturbed, samples_of
from fitters.stability.hazards.hazard import Hazard

NOISE = (0.01, 0.05, 0.10, 0.20)
"""0 is the undisturbed material."""
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
        "noise",
        "every sample is off by a normal share of itself, each channel for itself",
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
        f"dark noise of {OFFSET:g} medians takes samples below zero; or {DROPPED:.0%} of the samples are zero",
        ("negative", "zero"),
        _below_zero,
        random=True,
    ),
)
