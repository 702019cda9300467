"""Isotropic RGB measurements of the RGL database: the adaptive parameterisation of Dupuy and Jakob 2018.

A file holds, per incident angle, the reflected radiance over samples of the visible normals. The sample of two
directions is found by inverting the warp that the visible normals define; the value stored there, times
D(h) / (4 sigma(w_i)), is f(w_i, w_o) cos(theta_o).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fitters import cache
from fitters.errors import FittersError
from fitters.grid import CELLS, SHAPE, Array, above_horizon, cell_directions
from fitters.materials import tensor_file
from fitters.materials.material import Material, from_samples
from fitters.materials.material_file import Format, MaterialFile, read_file
from fitters.materials.warp import Place, Warp, between_nodes, bilinear, trilinear

RESAMPLE_VERSION = 1
CHUNK = 1 << 16
MAX_ELEMENTS = 1 << 22


@dataclass(frozen=True, eq=False)
class RglMaterial:
    """One isotropic measurement, ready to be evaluated.

    `theta_i` (n,) radians, increasing; `ndf` and `sigma` (rows, columns) over (azimuth, elevation); `visible`
    the warp of the n slices of visible normals; `samples` (n, rows, columns, 3) the stored radiance, without the
    factor D / (4 sigma) where `weighted` is true; `description` the text of the database.
    """

    theta_i: Array
    ndf: Array
    sigma: Array
    visible: Warp
    samples: Array
    weighted: bool
    description: str

    @classmethod
    def read(cls, path: Path) -> "RglMaterial":
        """The measurement in a `.bsdf` file; `FittersError` where it is damaged or of another kind."""
        return cls.of(read_file(path))

    @classmethod
    def of(cls, file: MaterialFile) -> "RglMaterial":
        """The measurement in a `.bsdf` file that has been read."""
        return cls.from_fields(tensor_file.parse(file.content, file.name), file.name)

    @classmethod
    def from_fields(cls, fields: Mapping[str, np.ndarray], name: str) -> "RglMaterial":
        """The measurement in the fields of a tensor file called `name`."""
        _refuse_other_kinds(fields, name)
        theta_i = _field(fields, "theta_i", name, ("angles",))
        count = len(theta_i)
        ndf = _field(fields, "ndf", name, ("rows", "columns"))
        sigma = _field(fields, "sigma", name, ("rows", "columns"))
        visible = _field(fields, "vndf", name, (1, count, "rows", "columns"))[0]
        samples = _field(fields, "rgb", name, (1, count, 3, "rows", "columns"), finite=False)[0]
        in_order = bool(np.all(np.diff(theta_i) > 0)) and theta_i[0] >= 0 and theta_i[-1] <= np.pi / 2 + 1e-3
        _require(in_order, name, "theta_i", "is not increasing within 0 to pi/2")
        _require(bool(np.all(ndf >= 0)), name, "ndf", "holds negative densities")
        _require(bool(np.all(sigma > 0)), name, "sigma", "holds projected areas that are not positive")
        lit = visible.min() >= 0 and bool(np.all(visible.max(axis=(1, 2)) > 0))
        _require(lit, name, "vndf", "holds negative densities or an empty slice")
        return cls(
            theta_i=theta_i,
            ndf=ndf,
            sigma=sigma,
            visible=Warp.of(visible),
            samples=np.ascontiguousarray(np.moveaxis(samples, 1, -1)),
            weighted=bool(np.any(fields.get("jacobian", np.ones(1)))),
            description=_text(fields.get("description")),
        )

    def evaluate(self, w_i: Array, w_o: Array) -> Array:
        """BRDF (..., 3) in sr^-1 for unit directions (..., 3), +z the normal; 0 below the horizon.

        As measured: not exactly reciprocal, and negative where a colour lies outside the RGB gamut.
        """
        w_i, w_o = np.broadcast_arrays(np.asarray(w_i, np.float64), np.asarray(w_o, np.float64))
        shape = w_i.shape
        w_i, w_o = w_i.reshape(-1, 3), w_o.reshape(-1, 3)
        out = np.zeros(w_i.shape)
        above = np.flatnonzero((w_i[:, 2] > 0) & (w_o[:, 2] > 0))
        with np.errstate(over="ignore", invalid="ignore"):
            for some in _chunks(above):
                out[some] = self._reflected(w_i[some], w_o[some]) / w_o[some, 2:]
        return out.reshape(shape)

    def resample(self) -> NDArray[np.float32]:
        """The table (3, 90, 90, 180) in sr^-1 at the cell centres, reciprocal; NaN below the horizon.

        Both orders of the two directions are averaged with the cosine of the outgoing one as weight: the file
        holds f cos(theta_o), so that equal weights would amplify its noise without bound near the horizon.
        """
        w_i, w_o = cell_directions()
        table = np.full((CELLS, 3), np.nan, np.float32)
        with np.errstate(over="ignore", invalid="ignore"):
            for some in _chunks(np.flatnonzero(above_horizon())):
                a, b = w_i[some], w_o[some]
                table[some] = (self._reflected(a, b) + self._reflected(b, a)) / (a[:, 2:] + b[:, 2:])
        return np.ascontiguousarray(table.T).reshape(3, *SHAPE)

    def _reflected(self, w_i: Array, w_o: Array) -> Array:
        """f(w_i, w_o) cos(theta_o) (m, 3) for directions (m, 3) above the horizon."""
        half = w_i + w_o
        theta_i, phi_i = _spherical(w_i)
        theta_h, phi_h = _spherical(half)
        # The paper's axes: the square root of the elevation, and the azimuth relative to the opposite of w_i.
        elevation_i, elevation_h = np.sqrt(theta_i * (2 / np.pi)), np.sqrt(theta_h * (2 / np.pi))
        azimuth = np.mod((phi_h - phi_i) / (2 * np.pi) + 0.5, 1.0)
        slices: Place = between_nodes(theta_i, self.theta_i)
        x, y = self.visible.invert(slices, elevation_h, azimuth)
        radiance = trilinear(self.samples, slices, x, y)
        if not self.weighted:
            return radiance
        area = bilinear(self.sigma, elevation_i, np.full(len(theta_i), 0.5))
        return radiance * (bilinear(self.ndf, elevation_h, azimuth) / (4.0 * area))[:, None]


def load(file: MaterialFile) -> Material:
    """The material in a `.bsdf` file; its table is kept in the disk cache."""
    key = cache.digest("rgl", RESAMPLE_VERSION, file.sha256)
    stored = cache.arrays("rgl", key, lambda: {"table": RglMaterial.of(file).resample()})
    return from_samples(file.stem, stored["table"], source="RGL", sha256=file.sha256)


def _refuse_other_kinds(fields: Mapping[str, np.ndarray], name: str) -> None:
    if "rgb" not in fields and "spectra" in fields:
        raise FittersError(
            f"{name} is the spectral file of this material: the RGB one is needed. "
            "Fetch the file of the same name that ends in _rgb.bsdf."
        )
    missing = [field for field in ("theta_i", "ndf", "sigma", "vndf", "rgb") if field not in fields]
    if missing:
        raise FittersError(
            f"{name} lacks the field{'s' * (len(missing) > 1)} {', '.join(missing)} of an RGL measurement: "
            "it is another kind of tensor file. Fetch an isotropic *_rgb.bsdf of the RGL database."
        )
    if fields.get("phi_i", np.zeros(1)).size != 1:
        raise FittersError(
            f"{name} is an anisotropic material ({fields['phi_i'].size} incident azimuths): the "
            "half/difference grid holds isotropic ones only. Choose an isotropic material."
        )


def _field(
    fields: Mapping[str, np.ndarray],
    field: str,
    name: str,
    shape: tuple[int | str, ...],
    *,
    finite: bool = True,
) -> NDArray[np.float64]:
    """A field of floats as float64. In `shape` a number is a size, a word stands for any size of at least 2."""
    array = fields[field]
    fits = array.ndim == len(shape) and all(
        size >= 2 if isinstance(wanted, str) else size == wanted
        for size, wanted in zip(array.shape, shape, strict=True)
    )
    _require(array.dtype.kind == "f", name, field, f"holds {array.dtype.name} numbers, floats are needed")
    expected = " x ".join(str(wanted) for wanted in shape)
    given = " x ".join(str(size) for size in array.shape)
    _require(fits, name, field, f"has the shape {given}, {expected} is needed")
    _require(array.size <= MAX_ELEMENTS, name, field, f"has {array.size:,} entries, more than {MAX_ELEMENTS:,}")
    _require(not finite or bool(np.isfinite(array).all()), name, field, "holds NaN or infinite numbers")
    return array.astype(np.float64)


def _require(condition: bool, name: str, field: str, problem: str) -> None:
    if not condition:
        raise FittersError(
            f"{name}: field {field!r} {problem}: the file is damaged or no isotropic RGB measurement. "
            "Fetch it again from the RGL database."
        )


def _text(field: np.ndarray | None) -> str:
    return "" if field is None else field.tobytes().decode("utf-8", errors="replace").strip()


def _spherical(w: Array) -> tuple[Array, Array]:
    """Elevation from +z and azimuth (m,), radians, of vectors (m, 3) of any length."""
    return np.arctan2(np.hypot(w[:, 0], w[:, 1]), w[:, 2]), np.arctan2(w[:, 1], w[:, 0])


def _chunks(indices: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    return [indices[start : start + CHUNK] for start in range(0, len(indices), CHUNK)]


FORMAT = Format("RGL", ".bsdf", lambda head, size: head.startswith(tensor_file.MAGIC), load)
