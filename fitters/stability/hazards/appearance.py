"""Materials that are no single microfacet lobe: measured well, hard in themselves."""

import numpy as np

from fitters.grid import Array, bin_centres
from fitters.stability.case import Base, Case, formula_samples, other_truth, samples_of
from fitters.stability.hazards.hazard import Hazard

ALBEDOS = (0.2, 0.8)
DIELECTRIC = 0.05
"""What is left of the base's highlight over a diffuse body."""
COAT_ALPHA, COAT_R0 = 0.03, 0.04
SWING = 0.8


def _lambertian(base: Base, level: int, seed: int) -> Case:
    return other_truth("lambertian", DIELECTRIC * samples_of(base.material) + np.float32(ALBEDOS[level] / np.pi))


def _layered(base: Base, level: int, seed: int) -> Case:
    coat = formula_samples("ggx", *[{"p0": 0.0, "p1": 1.0, "p2": COAT_ALPHA, "p3": COAT_R0}] * 3)
    return other_truth("layered", samples_of(base.material) + coat)


def tint() -> Array:
    """Factors (3, 1, 90, 1) by which the colour turns with theta_diff, each channel a third of a period on."""
    phase = 2 * np.pi * (bin_centres()[1] / (np.pi / 2))[None, :] + np.arange(3)[:, None] * (2 * np.pi / 3)
    return (1 + SWING * np.sin(phase)).astype(np.float32)[:, None, :, None]


def _colour_changing(base: Base, level: int, seed: int) -> Case:
    return other_truth("colour-changing", samples_of(base.material) * tint())


HAZARDS = (
    Hazard(
        "lambertian",
        "a diffuse body under a weak highlight",
        tuple(f"albedo {albedo:g}" for albedo in ALBEDOS),
        _lambertian,
    ),
    Hazard("layered", f"a smooth coat (GGX, alpha {COAT_ALPHA:g}) over the material", ("coat",), _layered),
    Hazard("colour-changing", "the colour turns with the difference angle", ("one turn",), _colour_changing),
)
