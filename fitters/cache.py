"""A cache on disk by content hash: what is slow to build is built once per machine.

The folder is `GPSEARCH_CACHE` where that is set, else the user's cache folder. Files are written beside their
name and moved into place, so that processes may share them; a damaged one is thrown away and built again.
"""

import hashlib
import os
import tempfile
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import BinaryIO

import numpy as np
import platformdirs


def folder() -> Path:
    """The cache folder, which need not exist yet."""
    return Path(os.environ.get("GPSEARCH_CACHE") or platformdirs.user_cache_path("gpsearch"))


def digest(*parts: object) -> str:
    """A hexadecimal content hash (32 digits) of bytes, arrays and anything with a stable `repr`."""
    state = hashlib.sha256()
    for part in parts:
        if isinstance(part, np.ndarray):
            state.update(f"{part.dtype.str}{part.shape}".encode())
            part = np.ascontiguousarray(part).tobytes()
        elif not isinstance(part, bytes):
            part = repr(part).encode()
        state.update(len(part).to_bytes(8, "little") + part)
    return state.hexdigest()[:32]


@lru_cache
def of_code(*folders: Path) -> str:
    """A content hash of the modules in folders, for results that depend on how they are computed."""
    return digest(*(path.read_bytes() for folder in folders for path in sorted(folder.glob("*.py"))))


def arrays(kind: str, key: str, build: Callable[[], Mapping[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """The named arrays that `build` returns, from the cache's `kind-key.npz` where it is there and whole.

    A folder that cannot be written costs the caching, never the result.
    """
    path = folder() / f"{kind}-{key}.npz"
    try:
        with np.load(path, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except FileNotFoundError:
        pass
    except Exception:
        # A damaged or foreign file: np.load raises many kinds (zipfile, zlib, value, OS errors).
        path.unlink(missing_ok=True)
    built = dict(build())
    write(path, lambda file: np.savez(file, **built))  # type: ignore[arg-type]
    return built


def write(path: Path, save: Callable[[BinaryIO], object]) -> None:
    """Puts what `save` writes in the place of `path`, whole: other processes see the old file or the new one.

    Does nothing where the folder cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor, temporary = tempfile.mkstemp(dir=path.parent, suffix=".part")
        try:
            with os.fdopen(descriptor, "wb") as file:
                save(file)
            os.replace(temporary, path)
        except OSError:
            Path(temporary).unlink(missing_ok=True)
    except OSError:
        pass
