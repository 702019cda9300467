"""The engine: from an expression to the best parameters per target, fast. Start with the README beside this."""

from pathlib import Path

import numba

from fitters import cache


def _compiled_folder() -> Path:
    """Where numba keeps the compiled machine, by the content of every file here.

    numba itself looks at the file of a cached function only, not at those whose functions it compiled into it:
    after an edit of math32.py it would go on with the old code.
    """
    sources = [path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py"))]
    return cache.folder() / f"compiled-{cache.digest(*sources)}"


if not numba.config.CACHE_DIR:
    numba.config.CACHE_DIR = str(_compiled_folder())
