"""The light table of the built-in sphere in closed form."""

import numpy as np

from fitters.grid import SHAPE, Array
from fitters.scenes.environment import EnvironmentMap
from fitters.scenes.rings import ring_energies

RINGS = 4
"""Rings in a bin of theta_diff."""
AZIMUTHS = 4
"""Points of a Gauss rule in a bin of phi_diff."""


def sphere_light(light: EnvironmentMap, *, degrees: float = 0.0) -> Array:
    """Light through each cell (3, 90, 90, 180) of the sphere under a map that is turned by `degrees` about +y."""
    return sphere_table(ring_energies(light, RINGS * SHAPE[1], degrees=degrees))


def sphere_table(rings: Array) -> Array:
    """Light through each cell (3, 90, 90, 180) of the sphere under a light of these `ring_energies` (rings, 3).

    As the camera is orthographic, w_o is the same at every pixel, and theta_diff of a light direction is half its
    angle to w_o whatever the normal. The mean over pixels is an integral of cos(theta_o) d omega_n / pi over
    normals, which as seen from the half vector is sin(theta_half) d theta_half d phi_diff, so that

        T = 1 / pi integral of E(theta_diff) cos(theta_i) cos(theta_o) sin(theta_half) over the cell,

    where E is the light of the ring at 2 theta_diff about the view, and the cosines are those of Rusinkiewicz
    (1998). Over theta_half the integral is exact, up to the horizon where that divides the cell; over phi_diff it
    is a Gauss rule, and light is taken to lie in the middle of its ring. The number of rings is a multiple of 90.
    """
    halves, diffs, azimuths = SHAPE
    parts = len(rings) // diffs
    theta_diff = (np.arange(len(rings)) + 0.5) / len(rings) * (np.pi / 2)
    points, shares = np.polynomial.legendre.leggauss(AZIMUTHS)
    table = np.zeros((3, *SHAPE))
    for point, share in zip(points, shares, strict=True):
        phi_diff = (np.arange(azimuths) + (point + 1) / 2) / azimuths * np.pi
        # phi_diff is taken modulo pi: a cell covers both halves of the turn.
        density = _over_theta_half(theta_diff, phi_diff) * (share / 2 * np.pi / azimuths * 2 / np.pi)
        lit = rings.T[:, None, :, None] * density[None]
        table += lit.reshape(3, halves, diffs, parts, azimuths).sum(axis=3)
    return table


def _over_theta_half(theta_diff: Array, phi_diff: Array) -> Array:
    """The integrals of cos(theta_i) cos(theta_o) sin(theta_half) over the bins of theta_half, both directions
    above the horizon: (90, n, m) at theta_diff (n,) and phi_diff (m,).
    """
    edges = (np.arange(SHAPE[0] + 1) / SHAPE[0]) ** 2 * (np.pi / 2)
    cos_diff = np.cos(theta_diff)[:, None]
    across = np.sin(theta_diff)[:, None] * np.abs(np.cos(phi_diff))
    # cos_i cos_o = (cos_h cos_d)^2 - (sin_h sin_d cos_phi)^2 is positive below this cosine's angle.
    horizon = across / np.hypot(cos_diff, across)
    x = np.maximum(np.cos(edges)[:, None, None], horizon)
    along, sideways = cos_diff**2, across**2
    return -np.diff((along + sideways) * x**3 / 3 - sideways * x, axis=0)
