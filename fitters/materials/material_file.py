"""A material file's content, read with errors that tell a user what to do."""

import hashlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from fitters.errors import FittersError

MAX_BYTES = 1 << 28


@dataclass(frozen=True, eq=False)
class MaterialFile:
    """A file that has been read: `name` is what messages call it, `stem` what its material is called."""

    name: str
    stem: str
    content: bytes

    @cached_property
    def sha256(self) -> str:
        """Hexadecimal hash of the content."""
        return hashlib.sha256(self.content).hexdigest()


def read_file(path: Path) -> MaterialFile:
    """Read a file; `FittersError` where it is empty, unreadable, or larger than any isotropic measurement."""
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
