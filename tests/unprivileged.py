"""Files that may not be read or written, whoever runs the tests."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

NOBODY = 65534


@contextmanager
def unprivileged() -> Iterator[None]:
    """Within it, permissions count for root too, which becomes nobody."""
    is_root = os.geteuid() == 0
    if is_root:
        os.seteuid(NOBODY)
    try:
        yield
    finally:
        if is_root:
            os.seteuid(0)


@contextmanager
def public_folder() -> Iterator[Path]:
    """A fresh folder that everybody may enter but only its owner may write to."""
    with TemporaryDirectory() as name:
        Path(name).chmod(0o755)
        yield Path(name)
