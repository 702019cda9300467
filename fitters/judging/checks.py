"""What a renderer needs of a BRDF besides a small error: reciprocity, no negative value, no gain of energy."""

from dataclasses import dataclass

import numpy as np

from fitters.expressions import Expression, evaluate
from fitters.fitting.cell_fit import Fit
from fitters.grid import Array

DIRECTIONS = 2000
"""The number of random pairs of directions at which reciprocity is checked."""


@dataclass(frozen=True)
class Checks:
    """reciprocity: largest relative difference of f(w_i, w_o) and f(w_o, w_i), over targets and directions
    minimum:     smallest value, sr^-1, over targets and lit cells
    albedo_max:  largest directional albedo, over targets and angles of incidence up to 85 degrees
    """

    reciprocity: float
    minimum: float
    albedo_max: float


def check(expression: Expression, fit: Fit, minimum: float) -> Checks:
    """The checks of a fitted expression whose smallest value is known; infinite where values are not finite."""
    albedo = 0.0
    for target in range(len(fit.values)):
        parameters = fit.parameters(target)
        albedo = max(albedo, *(directional_albedo(expression, parameters, angle) for angle in _ANGLES))
    return Checks(reciprocity(expression, fit), minimum, albedo)


def reciprocity(expression: Expression, fit: Fit) -> float:
    """The largest relative difference of f(w_i, w_o) and f(w_o, w_i); infinite where they are not numbers."""
    w_i, w_o = _random_pairs()
    largest = 0.0
    for target in range(len(fit.values)):
        parameters = fit.parameters(target)
        forth = evaluate(expression, parameters, w_i, w_o)
        back = evaluate(expression, parameters, w_o, w_i)
        with np.errstate(all="ignore"):
            difference = np.abs(forth - back) / np.maximum(np.abs(forth), np.abs(back))
        # 0 and 0 agree, infinity and infinity, too; their quotient is not a number.
        difference[forth == back] = 0.0
        largest = max(largest, float(np.nan_to_num(difference, nan=np.inf).max()))
    return largest


_ANGLES = np.radians([0.0, 15.0, 30.0, 45.0, 60.0, 70.0, 80.0, 85.0])


def directional_albedo(expression: Expression, parameters: dict[str, float], theta: float) -> float:
    """The reflected share of the light from polar angle `theta` (radians); infinite where the formula is.

    Integrates over half vectors, as dense around the normal as the grid, so that the sharpest lobe is seen:
    d omega_o = 4 (w_o . w_h) d omega_h.
    """
    u, phi = np.meshgrid((np.arange(96) + 0.5) / 96, (np.arange(64) + 0.5) / 64 * 2 * np.pi, indexing="ij")
    theta_h = u**2 * (np.pi / 2)
    half = np.stack([np.sin(theta_h) * np.cos(phi), np.sin(theta_h) * np.sin(phi), np.cos(theta_h)], axis=-1)
    solid_angle = np.sin(theta_h) * (np.pi * u / 96) * (2 * np.pi / 64)
    w_i = np.array([np.sin(theta), 0.0, np.cos(theta)])
    projection = half @ w_i
    w_o = 2 * projection[..., None] * half - w_i
    seen = (projection > 0) & (w_o[..., 2] > 1e-4)
    w_o, weight = w_o[seen], (4 * projection * solid_angle * w_o[..., 2])[seen]
    values = evaluate(expression, parameters, np.broadcast_to(w_i, w_o.shape), w_o)
    with np.errstate(all="ignore"):
        albedo = float(np.sum(values * weight))
    return albedo if np.isfinite(albedo) else float("inf")


def _random_pairs() -> tuple[Array, Array]:
    """Pairs of unit directions (n, 3) up to 85 degrees from the normal, the same in every call."""
    rng = np.random.default_rng(0)
    z = rng.uniform(np.cos(np.radians(85)), 1.0, (2, DIRECTIONS))
    phi = rng.uniform(0, 2 * np.pi, (2, DIRECTIONS))
    r = np.sqrt(1 - z**2)
    pairs = np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1)
    return pairs[0], pairs[1]
