"""What several tests of materials need: files written on the spot, and the shared data where it is there."""

import struct
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from tests.shared_data import SHARED

ELEMENT_CODES = {"uint8": 1, "uint32": 5, "int32": 6, "uint64": 7, "float32": 10, "float64": 11}

Fields = dict[str, np.ndarray]


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GPSEARCH_CACHE", str(tmp_path / "cache"))


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of development data beside the checkout."""
    if not (SHARED / "data").is_dir():
        pytest.skip(f"{SHARED} is not there: this test compares with its data")
    return SHARED


def _tensor_bytes(fields: Mapping[str, np.ndarray]) -> bytes:
    """A tensor file of version 1.0, written after the format's description."""
    header = 18 + sum(2 + len(name.encode()) + 11 + 8 * array.ndim for name, array in fields.items())
    out, data, offset = [b"tensor_file\0", struct.pack("<BBI", 1, 0, len(fields))], [], header
    for name, array in fields.items():
        label, content = name.encode(), np.ascontiguousarray(array).tobytes()
        out.append(struct.pack("<H", len(label)) + label)
        out.append(
            struct.pack(f"<HBQ{array.ndim}Q", array.ndim, ELEMENT_CODES[array.dtype.name], offset, *array.shape)
        )
        data.append(content)
        offset += len(content)
    return b"".join(out + data)


@pytest.fixture
def tensor_bytes() -> Callable[[Mapping[str, np.ndarray]], bytes]:
    """Lays fields out as a tensor file."""
    return _tensor_bytes


@pytest.fixture
def simple_fields() -> Fields:
    """An RGL measurement with a closed form.

    Visible normals are spread evenly for light from the zenith and grow linearly with elevation for light
    from the horizon; radiance is linear over the samples, D = 2 and sigma = 0.5, so that D / (4 sigma) = 1.
    """
    x, y = np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 5))
    vndf = np.stack([np.ones((6, 9)), np.tile(np.linspace(0, 2, 9), (6, 1))])
    rgb = np.stack([1 + x, 1 + y, -0.5 + 0 * x])
    return {
        "description": np.frombuffer(b"a closed form", np.uint8),
        "theta_i": np.array([0, np.pi / 2], np.float32),
        "phi_i": np.zeros(1, np.float32),
        "ndf": np.full((2, 3), 2, np.float32),
        "sigma": np.full((2, 3), 0.5, np.float32),
        "vndf": vndf[None].astype(np.float32),
        "luminance": np.ones((1, 2, 5, 5), np.float32),
        "rgb": np.stack([rgb, rgb])[None].astype(np.float32),
        "jacobian": np.ones(1, np.uint8),
    }


@pytest.fixture
def write_bsdf(tmp_path: Path) -> Callable[[Mapping[str, np.ndarray]], Path]:
    """Writes fields as a `.bsdf` file and returns its path."""

    def write(fields: Mapping[str, np.ndarray]) -> Path:
        path = tmp_path / "sample_rgb.bsdf"
        path.write_bytes(_tensor_bytes(fields))
        return path

    return write


@pytest.fixture
def random_pairs() -> tuple[np.ndarray, np.ndarray]:
    """300 random pairs of directions (300, 3) within 70 degrees of the normal."""
    random = np.random.default_rng(7)
    cos = random.uniform(np.cos(np.radians(70)), 1, (2, 300))
    phi, sin = random.uniform(0, 2 * np.pi, (2, 300)), np.sqrt(1 - cos**2)
    w_i, w_o = np.stack([sin * np.cos(phi), sin * np.sin(phi), cos], axis=-1)
    return w_i, w_o
