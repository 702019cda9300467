"""Built-in materials that need no file: formulas with measurement-like noise, the same on every machine.

No published formula reproduces them exactly: they have two lobes with tails of different length (Burley 2012,
appendix B.2), a diffuse part that changes towards grazing angles, and a retro-reflective lobe for fabric.
"""

import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from fitters import cache
from fitters.errors import FittersError
from fitters.grid import CELLS, SHAPE, Array, above_horizon, cell_directions
from fitters.materials.material import RGB, Material, from_samples

PREFIX = "builtin:"
# Part of every hash: raise it with every change of the formulas below that changes a table.
VERSION = 1
SEED = 2018


@dataclass(frozen=True)
class Lobe:
    """A specular lobe: roughness `alpha`, exponent `tail` (2 is GGX, smaller makes the tail longer), its share."""

    alpha: float
    tail: float
    share: float


@dataclass(frozen=True)
class BuiltIn:
    """The numbers of a built-in material, linear RGB: `specular` reflectance at normal incidence, `diffuse` and
    `sheen` albedos, `retro` a peak in sr^-1.
    """

    specular: RGB
    lobes: tuple[Lobe, ...]
    diffuse: RGB = (0.0, 0.0, 0.0)
    diffuse_roughness: float = 0.5
    sheen: RGB = (0.0, 0.0, 0.0)
    retro: RGB = (0.0, 0.0, 0.0)
    retro_width: float = 0.3


BUILT_IN: Mapping[str, BuiltIn] = {
    "metal": BuiltIn((0.91, 0.60, 0.42), (Lobe(0.11, 2.0, 0.7), Lobe(0.30, 1.5, 0.3))),
    "glossy-plastic": BuiltIn(
        (0.045, 0.045, 0.045),
        (Lobe(0.06, 1.8, 0.85), Lobe(0.22, 1.4, 0.15)),
        diffuse=(0.05, 0.17, 0.42),
        diffuse_roughness=0.3,
    ),
    "rough-plastic": BuiltIn(
        (0.04, 0.04, 0.04),
        (Lobe(0.32, 2.2, 0.8), Lobe(0.55, 1.6, 0.2)),
        diffuse=(0.46, 0.10, 0.07),
        diffuse_roughness=0.6,
    ),
    "fabric": BuiltIn(
        (0.03, 0.03, 0.03),
        (Lobe(0.75, 2.0, 1.0),),
        diffuse=(0.20, 0.11, 0.26),
        diffuse_roughness=0.9,
        sheen=(0.10, 0.08, 0.12),
        retro=(0.06, 0.04, 0.07),
    ),
}


def builtin_names() -> tuple[str, ...]:
    """The names that may follow `builtin:`."""
    return tuple(BUILT_IN)


def load(name: str) -> Material:
    """The built-in material called `name`; `FittersError` where there is none, with the nearest name."""
    if name not in BUILT_IN:
        near = difflib.get_close_matches(name, BUILT_IN, n=1, cutoff=0.3)
        hint = f" Did you mean {PREFIX}{near[0]}?" if near else ""
        known = ", ".join(BUILT_IN)
        raise FittersError(f"{PREFIX}{name} is no built-in material.{hint} There are {known}.")
    return _make(name)


@lru_cache(maxsize=4)
def _make(name: str) -> Material:
    built_in = BUILT_IN[name]
    # The seed of the noise of version 1 is made from this text.
    numbers = repr(built_in).replace("BuiltIn(", "Recipe(", 1)
    key = cache.digest("built-in", VERSION, SEED, name, numbers.encode())
    above = above_horizon().ravel()
    w_i, w_o = (w[above] for w in cell_directions())
    samples = np.full((3, CELLS), np.nan, np.float32)
    samples[:, above] = brdf(built_in, w_i, w_o).T * _noise(key, w_i, w_o).T
    return from_samples(name, samples.reshape(3, *SHAPE), source="built-in", sha256=key)


def brdf(built_in: BuiltIn, w_i: Array, w_o: Array) -> Array:
    """The noise-free BRDF (n, 3) in sr^-1 for unit directions (n, 3) above the horizon."""
    half = w_i + w_o
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    cos_i, cos_o, cos_h, cos_d = w_i[:, 2], w_o[:, 2], half[:, 2], np.sum(w_i * half, axis=1)
    grazing = (1.0 - np.clip(cos_d, 0.0, 1.0)) ** 5
    specular = np.zeros(len(w_i))
    for lobe in built_in.lobes:
        specular += lobe.share * _ndf(lobe, cos_h) * _visibility(lobe.alpha, cos_i, cos_o)
    theta_d = np.arccos(np.clip(cos_d, 0.0, 1.0))
    retro = np.exp(-((theta_d / built_in.retro_width) ** 2)) * np.sqrt(cos_i * cos_o)
    fresnel = np.asarray(built_in.specular) + (1.0 - np.asarray(built_in.specular)) * grazing[:, None]
    return (
        fresnel * specular[:, None]
        + np.asarray(built_in.diffuse) * _diffuse(built_in.diffuse_roughness, cos_i, cos_o, cos_d)[:, None]
        + np.asarray(built_in.sheen) * ((1.0 - cos_d) ** 3 / np.pi)[:, None]
        + np.asarray(built_in.retro) * retro[:, None]
    )


def _ndf(lobe: Lobe, cos_h: Array) -> Array:
    """Generalised Trowbridge-Reitz distribution (n,), normalised; Burley 2012, appendix B.2."""
    a2, power = lobe.alpha**2, 1.0 - lobe.tail
    scale = -power * (a2 - 1.0) / (np.pi * (1.0 - a2**power))
    return scale / (1.0 + (a2 - 1.0) * cos_h**2) ** lobe.tail


def _visibility(alpha: float, cos_i: Array, cos_o: Array) -> Array:
    """Height-correlated Smith shadowing of GGX over 4 cos_i cos_o (n,); Heitz 2014, eq. 99."""
    a2 = alpha**2
    towards_i = cos_o * np.sqrt(a2 + (1.0 - a2) * cos_i**2)
    towards_o = cos_i * np.sqrt(a2 + (1.0 - a2) * cos_o**2)
    return 0.5 / (towards_i + towards_o)


def _diffuse(roughness: float, cos_i: Array, cos_o: Array, cos_d: Array) -> Array:
    """Diffuse reflection of albedo about 1 (n,) that brightens at grazing; Burley 2012, section 5.3."""
    rise = 2.0 * roughness * cos_d**2 - 0.5
    return (1.0 + rise * (1.0 - cos_i) ** 5) * (1.0 + rise * (1.0 - cos_o) ** 5) / np.pi


def _noise(key: str, w_i: Array, w_o: Array) -> Array:
    """Log-normal factors (n, 3): 2 % at normal incidence to 12 % at grazing, half common to the channels."""
    random = np.random.Generator(np.random.PCG64(int(key, 16)))
    common, own = random.standard_normal((len(w_i), 1)), random.standard_normal((len(w_i), 3))
    spread = 0.02 + 0.10 * (1.0 - np.minimum(w_i[:, 2], w_o[:, 2])) ** 4
    return np.exp(spread[:, None] * np.sqrt(0.5) * (common + own))


def matte(value: float = 0.2) -> Material:
    """A material with the same value, in sr^-1, in every cell and channel."""
    samples = np.full((3, *SHAPE), value, np.float32)
    return from_samples("matte", samples, source="matte", sha256=cache.digest("matte", value))
