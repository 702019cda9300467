"""Compiled code on disk: decorators as numba's, for functions that are to be compiled once on a machine.

numba's own cache believes what its files hold: an incomplete one raises, a flipped bit is executed. Here a
compiled function is one file that begins with a checksum of the rest. What is missing, damaged or unreadable is
compiled again and written where that is possible. There is a file for each function and signature and no index
of them, and files are moved into place whole: processes that start at once replace each other's with equals.

What this relies on in numba, besides its decorators:

- a compiled function asks `_cache.load_overload` before it compiles and calls `_cache.save_overload` after;
- `CompileResult._reduce` and `_rebuild` turn code into what `serialize.dumps` can pickle, and back;
- `has_dynamic_globals` says whether code holds addresses of its process, `magic_tuple` for which processor it is;
- `cfunc` compiles before it returns, so that a `CFunc` which is to ask this cache first is made by hand.
"""

import functools
import pickle
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import NullCache
from numba.core.ccallback import CFunc
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from fitters import cache

SHARED = tuple(
    Path(__file__).parent / name
    for name in ("backends/machine.py", "backends/math32.py", "expressions/operators.py")
)
"""Files whose functions, or facts, are compiled into code of other folders."""


def entry(**options: Any) -> Callable[[Callable], Any]:
    """`numba.njit(**options)`, kept on disk."""

    def decorate(function: Callable) -> Any:
        compiled = numba.njit(**options)(function)
        compiled._cache = _OnDisk(function)
        return compiled

    return decorate


def c_function(signature: Any, **options: Any) -> Callable[[Callable], CFunc]:
    """`numba.cfunc(signature, **options)`, kept on disk."""

    def decorate(function: Callable) -> CFunc:
        compiled: Any = CFunc(function, (signature.args, signature.return_type), locals={}, options=options)
        compiled._cache = _OnDisk(function)
        compiled.compile()
        return compiled

    return decorate


@functools.cache
def folder(sources: Path) -> Path:
    """Where the code compiled from the files in `sources` is kept: named after their content and that of `SHARED`.

    A function's own file would not do, since functions of others are compiled into it.
    """
    contents = [path.read_bytes() for path in (*sorted(sources.glob("*.py")), *SHARED)]
    return cache.folder() / f"compiled-{cache.digest(*contents)}"


class _OnDisk(NullCache):
    """What numba asks for the code of one function; `NullCache` has the rest of the interface."""

    def __init__(self, function: Callable):
        self._name = f"{function.__module__}.{function.__qualname__}"
        self._folder = folder(Path(function.__code__.co_filename).parent)

    def load_overload(self, signature: Any, target_context: Any) -> CompileResult | None:
        target_context.refresh()
        path = self._path(signature, target_context.codegen())
        try:
            checksum, _, content = path.read_bytes().partition(b"\n")
        except OSError:
            return None
        if checksum != _checksum(path, content):
            return None
        return CompileResult._rebuild(target_context, *pickle.loads(content))

    def save_overload(self, signature: Any, result: CompileResult) -> None:
        if result.library.has_dynamic_globals:
            return
        path = self._path(signature, result.codegen)
        content = dumps(result._reduce())
        cache.write(path, lambda file: file.write(_checksum(path, content) + b"\n" + content))

    def _path(self, signature: Any, codegen: Any) -> Path:
        key = cache.digest(signature, codegen.magic_tuple(), numba.__version__, sys.version)
        return self._folder / f"{self._name}-{key}"


def _checksum(path: Path, content: bytes) -> bytes:
    """Over the name too: the code of another function or processor is no better than a damaged one."""
    return cache.digest(path.name, content).encode()
