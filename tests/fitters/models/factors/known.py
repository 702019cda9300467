"""Materials made from known factors, and the objective of eq. 7 written down once more, slowly and plainly."""

import numpy as np

from fitters.grid import CELLS, SHAPE, above_horizon, bin_centres, cell_directions
from fitters.materials.material import Material, from_samples
from fitters.models.factors.smith import smith
from fitters.models.factors.tables import MicrofacetFactors, NaiveFactors, SmithFactors

ALPHAS = (0.15, 0.25, 0.5)


def lobes() -> dict[str, np.ndarray]:
    """rho_d, rho_s (3,), D, F (90, 3) of three plausible channels: GGX distributions, Schlick's Fresnel term."""
    theta_half, theta_diff, _ = bin_centres()
    tan2, cos4 = np.tan(theta_half) ** 2, np.cos(theta_half) ** 4
    d = np.stack([1 / ((1 + tan2 / a**2) ** 2 * cos4) for a in ALPHAS], axis=1)
    f = np.stack([r + (1 - r) * (1 - np.cos(theta_diff)) ** 5 for r in (0.9, 0.3, 0.05)], axis=1)
    return {
        "rho_d": np.array([0.02, 0.1, 0.05]),
        "rho_s": np.array([4.0, 1.0, 0.5]),
        "D": np.maximum(d / d.max(axis=0), 1e-6),
        "F": f / f.max(axis=0),
    }


def microfacet() -> MicrofacetFactors:
    """With a G that no Smith integral of D gives."""
    theta = np.radians(np.arange(90))
    g = np.stack([np.cos(theta) ** p * (1 + 0.3 * np.sin(theta) ** 2) for p in (0.3, 0.6, 1.0)], axis=1)
    return MicrofacetFactors(**lobes(), G=g / g.max(axis=0))


def shadowed() -> SmithFactors:
    """With Smith's G of D."""
    known = lobes()
    return SmithFactors(**known, G=np.stack([smith().shadowing(known["D"][:, c]) for c in range(3)], axis=1))


def naive() -> NaiveFactors:
    """With an H that tells phi_diff from pi - phi_diff."""
    phi = bin_centres()[2]
    h = np.stack([1 + a * np.cos(phi) + 0.3 * np.sin(phi) for a in (0.1, 0.3, 0.5)], axis=1)
    return NaiveFactors(**lobes(), H=h / h.max(axis=0))


def material(model, name: str = "known") -> Material:
    """The model's values at the centres of all cells."""
    above = above_horizon().ravel()
    w_i, w_o = (w[above] for w in cell_directions())
    table = np.full((3, CELLS), np.nan, np.float32)
    table[:, above] = model.evaluate(w_i, w_o).T
    return from_samples(name, table.reshape(3, *SHAPE), source="made by a test", sha256=name)


def weights(of: Material, channel: int) -> np.ndarray:
    """w (90, 90, 180) by eqs. 8 to 12, 0 where a cell does not count."""
    theta_half, theta_diff, phi_diff = np.meshgrid(*bin_centres(), indexing="ij")
    w_i, w_o = (w.reshape(*SHAPE, 3) for w in cell_directions())
    z = of.table[channel].astype(np.float64)
    counted = of.valid & (np.degrees(np.arccos(w_i[..., 2])) <= 89) & (np.degrees(np.arccos(w_o[..., 2])) <= 89)
    sin2 = np.sin(theta_diff) ** 2
    steps = 2 * np.sqrt(theta_half) * np.sqrt(np.pi / 2) / 90 * (np.pi / 180) ** 2
    volume = np.sqrt(8 * sin2 * (np.cos(theta_diff) ** 2 + sin2 * np.cos(phi_diff) ** 2)) * steps
    fixed = np.where(counted, volume * w_i[..., 2] * w_o[..., 2], 0.0)
    order = np.argsort(z[counted])
    cumulative = np.cumsum(fixed[counted][order])
    median = z[counted][order][np.searchsorted(cumulative, cumulative[-1] / 2)]
    x = z / median
    f = (1 - np.exp(-np.log(2) * x)) / np.log(2)
    return fixed * np.where(x > 0, f / np.maximum(x, 1e-300), 1.0) ** 1.4


def objective(of: Material, channel: int, model) -> float:
    """Eq. 7 of a model's channel on a material."""
    w = weights(of, channel).ravel()
    values = model.evaluate(*cell_directions())[:, channel]
    return float(np.sum(w * (values - of.table[channel].ravel()) ** 2))
