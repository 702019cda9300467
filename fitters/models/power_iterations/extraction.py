"""From a material to its microfacet model: algorithms 1 to 3 and appendices A and C of Dupuy et al. 2015."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from fitters.errors import FittersError
from fitters.grid import Array, bin_centres
from fitters.materials import Material
from fitters.materials.synthetic import matte
from fitters.materials.utia import AnisotropicMaterial, sample_directions
from fitters.models.measured import MeasuredTable
from fitters.models.model import Model
from fitters.models.power_iterations import anisotropic, backscattering, fresnel, isotropic, reference
from fitters.models.power_iterations.anisotropic import azimuths
from fitters.models.power_iterations.anisotropic_model import AnisotropicMicrofacet
from fitters.models.power_iterations.backscattering import Evaluate
from fitters.models.power_iterations.conversion import Alphas, anisotropic_alphas, isotropic_alphas, tail_share
from fitters.models.power_iterations.model import TabulatedMicrofacet
from fitters.models.power_iterations.residual import residual
from fitters.models.power_iterations.settings import Settings
from fitters.models.power_iterations.slopes import Slopes, slopes
from fitters.models.power_iterations.warnings import about_fresnel, about_moments, about_residual

DEFAULT = Settings()


@dataclass(frozen=True, eq=False)
class Extraction:
    """What power iterations make of a material.

    `alpha_beckmann` and `alpha_ggx`: roughness after appendix C, of an anisotropic extraction
    (alpha_x, alpha_y, rho) each. `fresnel` (k, 3) over theta_d, and
    `fresnel_at_normal` its value for theta_d = 0, RGB. `iterations` until P stood still. `warnings`: sentences
    that say where the result is not what its names promise.
    """

    model: Model
    alpha_beckmann: float | Alphas
    alpha_ggx: float | Alphas
    fresnel: Array
    fresnel_at_normal: tuple[float, float, float]
    iterations: int
    warnings: tuple[str, ...]


def extract(material: Material, settings: Settings = DEFAULT) -> Extraction:
    """The isotropic microfacet model of a material, eqs. 22 to 24.

    Raises `FittersError` where the material shows no backscattering.
    """
    solve = _published if settings.published else _converged
    _loaded(solve)
    started = time.perf_counter()
    extraction = solve(material, settings)
    extraction.model.fit_seconds = time.perf_counter() - started
    return extraction


@cache
def _loaded(solve: Callable[[Material, Settings], Extraction]) -> None:
    """Extracts once from a matte material: no extraction's seconds count the compiling and loading of code."""
    solve(matte(), DEFAULT)


def extract_anisotropic(
    material: AnisotropicMaterial | Material | Evaluate, settings: Settings = DEFAULT
) -> Extraction:
    """The anisotropic microfacet model, eqs. 14 to 18, of a material or of a BRDF (n, 3) of w_i and w_o (n, 3).

    Raises `FittersError` where the material shows no backscattering, or for `Settings.reference()`.
    """
    if settings.published:
        raise FittersError("The reference settings repeat isotropic extractions only: use other settings here.")
    started = time.perf_counter()
    name, evaluate = _function(material)
    count, phi = settings.resolution, azimuths(settings.azimuths)
    data = backscattering.of_function(name, evaluate, phi, count)
    p, eigenvector = anisotropic.slope_pdf(data.values, settings.iterations, settings.tolerance)
    theta, cos_k = isotropic.nodes(count), isotropic.area_nodes(count)
    density = slopes(theta, p)
    tables = theta, p, np.arccos(cos_k), cos_k / anisotropic.projected_area(density, cos_k)
    ideal = AnisotropicMicrofacet(*tables, np.ones((2, 3))).evaluate
    if isinstance(material, AnisotropicMaterial):
        table = fresnel.table_at(*sample_directions(), material.table.reshape(3, -1).T, ideal)
    else:
        table = fresnel.table_of(evaluate, ideal)
    model = AnisotropicMicrofacet(*tables, table)
    beckmann, ggx = anisotropic_alphas(density)
    said = (*data.warnings, *about_moments(tail_share(density)), *about_fresnel(table))
    model.fit_seconds = time.perf_counter() - started
    return Extraction(model, beckmann, ggx, table, _rgb(table[0]), eigenvector.iterations, said)


def _function(material: AnisotropicMaterial | Material | Evaluate) -> tuple[str, Evaluate]:
    if isinstance(material, AnisotropicMaterial):
        return material.name, material.evaluate
    if isinstance(material, Material):
        return material.name, MeasuredTable(material.table).evaluate
    return getattr(material, "__name__", "the BRDF"), material


def _converged(material: Material, settings: Settings) -> Extraction:
    count = settings.resolution
    data = backscattering.of_table(material, count)
    p, eigenvector = isotropic.slope_pdf(data.values, settings.iterations, settings.tolerance)
    theta, cos_k = isotropic.nodes(count), isotropic.area_nodes(count)
    density = slopes(theta, p)
    area = isotropic.projected_area(density, cos_k)
    centres = bin_centres()[0]
    table = fresnel.table(material, _at(density, centres) / np.cos(centres) ** 4, area)
    model = TabulatedMicrofacet(theta, p, np.arccos(cos_k), cos_k / area, table)
    beckmann, ggx = isotropic_alphas(density)
    left = about_residual(residual(material, model))
    said = (*data.warnings, *about_moments(tail_share(density)), *about_fresnel(table), *left)
    return Extraction(model, beckmann, ggx, table, _rgb(table[0]), eigenvector.iterations, said)


def _published(material: Material, settings: Settings) -> Extraction:
    count = settings.resolution
    theta, p = reference.slope_pdf(material, count)
    area = reference.projected_area(p)
    table = reference.fresnel(material, p, area)
    theta_k = np.linspace(0, np.pi / 2, count)
    model = TabulatedMicrofacet(theta, p, theta_k, np.cos(theta_k) / area, table, published=True)
    beckmann, ggx = reference.alphas(p)
    return Extraction(model, beckmann, ggx, table, _rgb(table[0]), reference.ITERATIONS, ())


def _at(density: Slopes, theta: Array) -> Array:
    """P (m,) of one density at elevations (m,) below pi / 2."""
    t = np.log1p(np.tan(theta) ** 2)
    k = np.searchsorted(density.t, t, side="right") - 1
    return np.exp(density.log_p[k] + density.rate[k] * (t - density.t[k]))


def _rgb(row: Array) -> tuple[float, float, float]:
    red, green, blue = (float(value) for value in row)
    return red, green, blue
