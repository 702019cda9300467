"""Materials and scenes that are hard to fit although they were measured well."""

import numpy as np

from fitters.grid import Array, bin_centres
from fitters.scenes import EnvironmentMap, LightTable, load_light
from fitters.stability.case import (
    R0,
    Base,
    Case,
    Hazard,
    Known,
    formula_samples,
    other_truth,
    samples_of,
    thinned_light,
)

ALBEDOS = (0.2, 0.8)
DIELECTRIC = 0.05
"""The factor of the base's highlight over a diffuse body."""
COAT_ALPHA, COAT_R0 = 0.03, 0.04
SWING = 0.8


def _lambertian(base: Base, level: int, seed: int) -> Case:
    return other_truth("lambertian", DIELECTRIC * samples_of(base.material) + np.float32(ALBEDOS[level] / np.pi))


def _layered(base: Base, level: int, seed: int) -> Case:
    coat = formula_samples("ggx", *[{"p0": 0.0, "p1": 1.0, "p2": COAT_ALPHA, "p3": COAT_R0}] * 3)
    return other_truth("layered", samples_of(base.material) + coat)


def tint() -> Array:
    """Factors (3, 1, 90, 1) that change the colour with theta_diff: a period, the channels a third of it apart."""
    phase = 2 * np.pi * (bin_centres()[1] / (np.pi / 2))[None, :] + np.arange(3)[:, None] * (2 * np.pi / 3)
    return (1 + SWING * np.sin(phase)).astype(np.float32)[:, None, :, None]


def _colour_changing(base: Base, level: int, seed: int) -> Case:
    return other_truth("colour-changing", samples_of(base.material) * tint())


SHARP_ALPHA, MIRROR_ALPHA = 0.005, 0.02
SCALES = (1e-6, 1e6)
LIGHT_ROWS = 16
TEXEL = (4, 22)
"""Row and column of the only bright texel, of 16 x 32: 50 degrees from the zenith, behind the camera."""
CRESCENT = (8, 31)
"""Row and column of a texel behind the sphere, which lights almost nothing."""
COOK_TORRANCE = {"p0": 0.02, "p1": 1.0, "p2": 0.25, "p3": 0.3}


def _ggx(alpha: float) -> tuple[Array, Known]:
    channels = ({"p0": 0.0, "p1": 1.0, "p2": alpha, "p3": r0} for r0 in R0)
    return formula_samples("ggx", *channels), {"ggx": {"p2": alpha}}


def _sharp(base: Base, level: int, seed: int) -> Case:
    return other_truth("sharp peak", *_ggx(SHARP_ALPHA))


def _mirror(base: Base, level: int, seed: int) -> Case:
    return other_truth("mirror", *_ggx(MIRROR_ALPHA), one_texel(*TEXEL))


def one_texel(row: int, column: int) -> LightTable:
    """The light of a single texel with the energy of the whole studio."""
    radiance = np.zeros((LIGHT_ROWS, 2 * LIGHT_ROWS, 3))
    dark = EnvironmentMap(np.ones_like(radiance))
    radiance[row, column] = load_light("studio").power() / dark.solid_angles()[row]
    return thinned_light(EnvironmentMap(radiance))


def _dark_scene(base: Base, level: int, seed: int) -> Case:
    return Case(base.material, base.material, one_texel(*CRESCENT), base.known)


def _empty_channel(base: Base, level: int, seed: int) -> Case:
    samples = samples_of(base.material)
    samples[2] *= 0
    return other_truth("no blue", samples)


def _scale(base: Base, level: int, seed: int) -> Case:
    samples = samples_of(base.material) * np.float32(SCALES[level])
    return other_truth(f"scale {SCALES[level]:g}", samples, base.known)


def _trade_off(base: Base, level: int, seed: int) -> Case:
    known = {"cook-torrance": {name: COOK_TORRANCE[name] for name in ("p1", "p3")}}
    return other_truth("trade-off", formula_samples("cook-torrance", *[COOK_TORRANCE] * 3), known)


HAZARDS = (
    Hazard(
        "lambertian",
        "a diffuse body under a weak highlight",
        tuple(f"albedo {albedo:g}" for albedo in ALBEDOS),
        _lambertian,
    ),
    Hazard("layered", f"a smooth coat (GGX, alpha {COAT_ALPHA:g}) over the material", ("coat",), _layered),
    Hazard("colour-changing", "the colour turns with the difference angle", ("one turn",), _colour_changing),
    Hazard("sharp-peak", "an almost polished GGX metal", (f"alpha {SHARP_ALPHA:g}",), _sharp, any_base=False),
    Hazard(
        "mirror",
        f"a GGX metal of alpha {MIRROR_ALPHA:g} under a light of one texel",
        ("one texel",),
        _mirror,
        any_base=False,
    ),
    Hazard("empty-channel", "the blue channel is zero throughout", ("blue",), _empty_channel),
    Hazard("scale", "values in other units", tuple(f"{scale:g}" for scale in SCALES), _scale),
    Hazard("dark-scene", "one texel behind the sphere lights a crescent of it", ("crescent",), _dark_scene),
    Hazard(
        "trade-off",
        "eq. 5 of the genBRDF paper: with N.H in the Fresnel term, R0 and the specular scale do nearly the same",
        ("R0 and scale",),
        _trade_off,
        any_base=False,
    ),
)
