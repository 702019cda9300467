"""The MERL binary format (Matusik et al. 2003): how the 100 released materials are stored.

Three little-endian int32 (90, 90, 180), then the planes red, green and blue in float64, in the order of the grid,
each divided by its channel's scale. Cells that were not measured hold negative numbers.
"""

from functools import cache
from importlib import resources
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fitters.errors import FittersError
from fitters.grid import CELLS, SHAPE, Array
from fitters.materials.material import Material, from_samples
from fitters.materials.material_file import Format, MaterialFile

SCALE = np.array([1.0, 1.15, 1.66]) / 1500.0
HEADER = np.array(SHAPE, "<i4").tobytes()
FILE_BYTES = len(HEADER) + 3 * CELLS * 8


@cache
def _genuine() -> dict[str, str]:
    """Names of the 100 released files by the hash of their content; a line holds hash, size and name."""
    listing = resources.files("fitters.materials").joinpath("merl_sha256.txt").read_text("utf-8")
    lines = [line.split() for line in listing.splitlines() if line.strip()]
    return {sha256: name for sha256, _, name in lines}


def genuine_merl_name(sha256: str) -> str | None:
    """The released MERL file with this content, such as `chrome.binary`; None where it is none of the 100."""
    return _genuine().get(sha256)


def load(file: MaterialFile) -> Material:
    """The material in a `.binary` file. Raises `FittersError` where it is not a whole MERL file."""
    genuine = genuine_merl_name(file.sha256)
    source = f"MERL, genuine {genuine}" if genuine else "MERL format, not one of the released files"
    return from_samples(file.stem, _samples(file), source=source, sha256=file.sha256, all_negative_is_missing=True)


def write_merl(path: Path, table: Array, valid: NDArray[np.bool_]) -> None:
    """Write a table (3, 90, 90, 180) in sr^-1 as a MERL file; cells outside `valid` (90, 90, 180) hold -1."""
    if table.shape != (3, *SHAPE) or valid.shape != SHAPE:
        raise FittersError(
            f"{path.name}: a MERL file takes a table (3, 90, 90, 180) and a mask (90, 90, 180), "
            f"not {table.shape} and {valid.shape}"
        )
    with path.open("wb") as file:
        file.write(HEADER)
        for plane, scale in zip(table, SCALE, strict=True):
            np.where(valid, plane / scale, -1.0).astype("<f8").tofile(file)


def _samples(file: MaterialFile) -> NDArray[np.float32]:
    """Samples (3, 90, 90, 180) in sr^-1 as stored, negative and not finite ones included."""
    content = file.content
    if content[: len(HEADER)] != HEADER[: len(content)]:
        raise FittersError(
            f"{file.name} begins with {_header(content)}, a MERL file with 90, 90, 180: it is another "
            "kind of file. Check that the download is the .binary file itself, not a web page or an archive."
        )
    if len(content) != FILE_BYTES:
        short = len(content) < FILE_BYTES
        problem = "the download was cut short" if short else "something was appended to it"
        raise FittersError(
            f"{file.name} holds {len(content):,} bytes, a MERL file has {FILE_BYTES:,}: {problem}. Fetch it again."
        )
    stored = np.frombuffer(content, "<f8", offset=len(HEADER)).reshape(3, CELLS)
    samples = np.empty((3, CELLS), np.float32)
    with np.errstate(over="ignore", invalid="ignore"):
        for channel in range(3):
            np.multiply(stored[channel], SCALE[channel], out=samples[channel], casting="same_kind")
    return samples.reshape(3, *SHAPE)


def _header(content: bytes) -> str:
    if len(content) < len(HEADER):
        return f"only {len(content)} bytes"
    return ", ".join(str(size) for size in np.frombuffer(content, "<i4", 3))


FORMAT = Format("MERL", ".binary", lambda head, size: head.startswith(HEADER), load)
