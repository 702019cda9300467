"""What a material file and a file format are; files are read with errors that tell a user what to do."""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from fitters.errors import FittersError
from fitters.materials.material import Material

if TYPE_CHECKING:
    from fitters.materials.utia import AnisotropicMaterial

MAX_BYTES = 1 << 28

HEAD_BYTES = 64
"""The first bytes of a file, by which a format is recognised."""


@dataclass(frozen=True, eq=False)
class MaterialFile:
    """A file that has been read: `name` is used in messages, `stem` is the name of its material."""

    name: str
    stem: str
    content: bytes

    @cached_property
    def sha256(self) -> str:
        """Hexadecimal hash of the content."""
        return hashlib.sha256(self.content).hexdigest()


@dataclass(frozen=True)
class Format:
    """A file format of measurements.

    name:        what messages call it
    suffix:      the end of its files' names, in small letters
    anisotropic: whether its files hold anisotropic measurements
    recognises:  whether a file can be of this format, by its first `HEAD_BYTES` bytes and its size in bytes
    load:        the material in a file; raises `FittersError` that names the file and says what to do
    """

    name: str
    suffix: str
    recognises: Callable[[bytes, int], bool]
    load: "Callable[[MaterialFile], Material | AnisotropicMaterial]"
    anisotropic: bool = False


def read_file(path: Path) -> MaterialFile:
    """Reads a file. Raises `FittersError` where it is empty, unreadable, or larger than any measurement."""
    try:
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise FittersError(
                f"{path.name} holds {size:,} bytes, no isotropic RGB measurement more than {MAX_BYTES:,}: it "
                "is another kind of file. Check which one was meant."
            )
        content = path.read_bytes()
    except OSError as error:
        raise FittersError(f"{path} cannot be read ({error.strerror or error}): check its permissions.") from error
    if not content:
        raise FittersError(f"{path.name} is empty: the download failed. Fetch it again.")
    return MaterialFile(path.name, path.stem, content)
