"""The factors of a material in the paper's 3,264 bytes, or in 20 bits a component.

Section 3 of Bagher et al. 2016: 3 (3 90 + 2) floats of 4 bytes. Clamping leaves components a range of 1e-6 to 1,
so that 20 bits are enough: evenly spaced in the logarithm, a component keeps a relative error of 7e-6 at most, the
same for small ones as for large ones. rho_d and rho_s stay floats.
"""

import numpy as np

from fitters.errors import FittersError
from fitters.models.factors.alternation import FLOOR
from fitters.models.factors.tables import MicrofacetFactors

FLOAT_BYTES = 3264
BITS = 20
_COMPONENTS = 3 * 3 * 90
PACKED_BYTES = 6 * 4 + _COMPONENTS * BITS // 8
_STEPS = (1 << BITS) - 1
_FACTORS = ("D", "F", "G")


def to_floats(model: MicrofacetFactors) -> bytes:
    """rho_d, rho_s, D, F, G as little-endian float32, 3,264 bytes: relative errors of 6e-8."""
    return b"".join(model[name].astype("<f4").tobytes() for name in ("rho_d", "rho_s", *_FACTORS))


def from_floats(content: bytes) -> MicrofacetFactors:
    """The factors in `to_floats`' bytes. Raises `FittersError` for another number of bytes."""
    _check(content, FLOAT_BYTES)
    values = np.frombuffer(content, "<f4").astype(np.float64)
    return _model(values[:6], values[6:])


def to_packed(model: MicrofacetFactors) -> bytes:
    """rho_d, rho_s as float32, then D, F, G in 20 bits a component: 2,049 bytes.

    Components below 1e-6 count as 1e-6. Raises `FittersError` where one is above 1.
    """
    components = np.concatenate([model[name].ravel() for name in _FACTORS])
    if components.max() > 1.0:
        raise FittersError(f"the largest component is {components.max():.6g}: normalise each factor to 1 first")
    level = np.rint((1 - np.log(np.maximum(components, FLOOR)) / np.log(FLOOR)) * _STEPS).astype(np.uint32)
    bits = (level[:, None] >> np.arange(BITS - 1, -1, -1, dtype=np.uint32)) & 1
    head = np.concatenate([model["rho_d"], model["rho_s"]]).astype("<f4").tobytes()
    return head + np.packbits(bits.astype(np.uint8)).tobytes()


def from_packed(content: bytes) -> MicrofacetFactors:
    """The factors in `to_packed`'s bytes. Raises `FittersError` for another number of bytes."""
    _check(content, PACKED_BYTES)
    bits = np.unpackbits(np.frombuffer(content, np.uint8, offset=24))[: _COMPONENTS * BITS]
    level = bits.reshape(_COMPONENTS, BITS).astype(np.uint32) @ (1 << np.arange(BITS - 1, -1, -1, dtype=np.uint32))
    components = np.exp((1 - level / _STEPS) * np.log(FLOOR))
    return _model(np.frombuffer(content, "<f4", 6).astype(np.float64), components)


def _check(content: bytes, size: int) -> None:
    if len(content) != size:
        raise FittersError(
            f"{len(content):,} bytes are no factors, which take {size:,}: they were cut or are others"
        )


def _model(coefficients: np.ndarray, components: np.ndarray) -> MicrofacetFactors:
    d, f, g = components.reshape(3, 90, 3)
    return MicrofacetFactors(rho_d=coefficients[:3], rho_s=coefficients[3:], D=d, F=f, G=g)
