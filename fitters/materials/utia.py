"""The UTIA binary format (Filip and Vavra 2014): anisotropic materials, six elevations by 48 azimuths each way.

No header: the planes red, green, blue of 288 x 288 little-endian float64. Rows are light, columns view directions,
index 48 i + j for theta = 15 i degrees and phi = 7.5 j degrees. The numbers are taken as the BRDF in sr^-1.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numba import njit

from fitters import compiled
from fitters.errors import FittersError
from fitters.grid import Array
from fitters.materials.material import RGB
from fitters.materials.material_file import Format, MaterialFile

ELEVATIONS, AZIMUTHS = 6, 48
SHAPE = (3, ELEVATIONS, AZIMUTHS, ELEVATIONS, AZIMUTHS)
THETA_STEP, PHI_STEP = math.radians(15.0), math.radians(7.5)
FILE_BYTES = math.prod(SHAPE) * 8


@dataclass(frozen=True, eq=False)
class AnisotropicMaterial:
    """One anisotropic measurement.

    `table` (3, 6, 48, 6, 48) float32, sr^-1: RGB over theta_i, phi_i, theta_o, phi_o; finite, not negative.
    `negative` is, per channel, the share of samples below zero, which were set to 0.
    """

    name: str
    table: Array
    source: str
    sha256: str
    negative: RGB

    def __post_init__(self) -> None:
        if self.table.shape != SHAPE or self.table.dtype != np.float32:
            raise FittersError(
                f"{self.name}: a table is float32 (3, 6, 48, 6, 48), not {self.table.dtype} {self.table.shape}"
            )
        if not (self.table.min() >= 0 and self.table.max() < np.inf):
            raise FittersError(f"{self.name}: the table holds negative, NaN or infinite values")

    def evaluate(self, w_i: Array, w_o: Array) -> Array:
        """BRDF (n, 3), sr^-1, linear in the four angles; 0 where a direction is not above the horizon.

        phi is periodic. Nothing was measured beyond theta = 75 degrees: the value there is used up to the horizon.
        """
        values = np.zeros((len(w_i), 3))
        w_i, w_o = (np.ascontiguousarray(w, np.float64) for w in (w_i, w_o))
        _interpolate(self.table, w_i, w_o, values)
        return values


def load(file: MaterialFile) -> AnisotropicMaterial:
    """The material in a `.bin` file. Raises `FittersError` where it is not a whole UTIA file of finite numbers."""
    content = file.content
    if len(content) != FILE_BYTES:
        short = len(content) < FILE_BYTES
        problem = (
            "the download was cut short" if short else "something was appended to it, or it is of another kind"
        )
        raise FittersError(
            f"{file.name} holds {len(content):,} bytes, a UTIA file has {FILE_BYTES:,}: {problem}. Fetch it again."
        )
    with np.errstate(over="ignore", invalid="ignore"):
        samples = np.frombuffer(content, "<f8").astype(np.float32).reshape(SHAPE)
    unusable = ~np.isfinite(samples)
    if unusable.any():
        channel, i, phi_i, o, phi_o = (int(place) for place in np.argwhere(unusable)[0])
        raise FittersError(
            f"{file.name}: {np.count_nonzero(unusable):,} of {samples.size:,} samples are NaN or infinite, the "
            f"first in the {('red', 'green', 'blue')[channel]} plane, light ({15 * i}, {7.5 * phi_i:g}), view "
            f"({15 * o}, {7.5 * phi_o:g}) degrees: the file is damaged. Fetch it again."
        )
    red, green, blue = (float(np.mean(plane < 0)) for plane in samples)
    samples = np.maximum(samples, 0.0)
    if not samples.any():
        raise FittersError(f"{file.name}: no sample lies above 0: it holds no measurement. Fetch it again.")
    samples.flags.writeable = False
    return AnisotropicMaterial(file.stem, samples, "UTIA format", file.sha256, (red, green, blue))


@cache
def sample_directions() -> tuple[Array, Array]:
    """Unit w_i and w_o (82944, 3) of the samples, in the order of a channel's table."""
    theta, phi = np.arange(ELEVATIONS) * THETA_STEP, np.arange(AZIMUTHS) * PHI_STEP
    sine, cosine = np.repeat(np.sin(theta), AZIMUTHS), np.repeat(np.cos(theta), AZIMUTHS)
    azimuth = np.tile(phi, ELEVATIONS)
    w = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine], axis=-1)
    return np.repeat(w, len(w), axis=0), np.tile(w, (len(w), 1))


@njit
def _place(position: float, count: int) -> tuple[int, float]:
    node = min(int(position), count - 1)
    return node, position - node


@compiled.entry()
def _interpolate(table: Array, w_i: Array, w_o: Array, values: Array) -> None:
    for n in range(w_i.shape[0]):
        if not (w_i[n, 2] > 0 and w_o[n, 2] > 0):
            continue
        theta = (math.acos(min(w_i[n, 2], 1.0)) / THETA_STEP, math.acos(min(w_o[n, 2], 1.0)) / THETA_STEP)
        phi_i = math.atan2(w_i[n, 1], w_i[n, 0]) / PHI_STEP % AZIMUTHS
        phi_o = math.atan2(w_o[n, 1], w_o[n, 0]) / PHI_STEP % AZIMUTHS
        a, share_a = _place(min(theta[0], ELEVATIONS - 1.0), ELEVATIONS)
        b, share_b = _place(min(theta[1], ELEVATIONS - 1.0), ELEVATIONS)
        c, share_c = _place(phi_i, AZIMUTHS)
        d, share_d = _place(phi_o, AZIMUTHS)
        for corner in range(16):
            up_a, up_b, up_c, up_d = corner & 1, corner >> 1 & 1, corner >> 2 & 1, corner >> 3
            weight = share_a if up_a else 1 - share_a
            weight *= share_b if up_b else 1 - share_b
            weight *= share_c if up_c else 1 - share_c
            weight *= share_d if up_d else 1 - share_d
            if weight > 0:
                for channel in range(3):
                    values[n, channel] += (
                        weight * table[channel, a + up_a, (c + up_c) % AZIMUTHS, b + up_b, (d + up_d) % AZIMUTHS]
                    )


FORMAT = Format("UTIA", ".bin", lambda head, size: size == FILE_BYTES, load, anisotropic=True)
"""Its files have no header: they are recognised by their size."""
