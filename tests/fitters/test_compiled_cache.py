"""Compiled code on disk: whatever happens to the files, processes compute the same and leave good files behind."""

import json
import os
import pickle
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from numba.core.caching import NullCache
from numba.core.ccallback import CFunc
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from fitters import cache, compiled
from fitters.backends import machine
from fitters.backends.machine import run_scalars
from fitters.engine import multistart
from fitters.engine.warm import warm_up

REPOSITORY = Path(__file__).parents[2]

SCALARS = """
import json
import numpy as np
from fitters.backends import machine
from fitters.backends.machine import run_scalars
from fitters.backends.machine import SCALAR_OPCODE

registers = np.array([2.0, 3.0, 0.0, 0.0])
code = [(SCALAR_OPCODE["pow"], 2, 0, 1), (SCALAR_OPCODE["sin"], 3, 2, 2)]
run_scalars(np.array(code, np.int32), registers)
print(json.dumps([registers.tolist(), sum(run_scalars.stats.cache_hits.values())]))
"""
"""The smallest compiled function: prints what it computes and how often it was loaded."""

FIT = """
import json
import numpy as np
from fitters.backends.machine import _kernel
from fitters.engine.multistart import Descent, fit_targets, polish_targets
from fitters.engine.prepared import Prepared
from fitters.expressions.evaluation import FEATURES
from fitters.expressions.text import parse

cells = np.linspace(0.1, 0.9, 8)
ones, targets = np.ones((1, 8), np.float32), (0.5 * cells**1.5).astype(np.float32)[None]
bounds = {"p0": (0.1, 1.0), "p1": (0.1, 2.0)}
prepared = Prepared(parse("p0 * pow(wh.z, p1)"), dict.fromkeys(FEATURES, cells), ones, targets, bounds)
descent = Descent(1, 1, 0.5, 100, 1e-6, np.inf, np.inf)
polished = prepared.polish(descent, prepared.fit(np.zeros((1, 1)), np.zeros((0, 1)), descent))
found = [float(values[0]) for values in prepared.parameters(polished).values()]
loaded = [sum(entry.stats.cache_hits.values()) for entry in (fit_targets, polish_targets)]
print(json.dumps([found, sum(loaded) + _kernel().cache_hits]))
"""
"""A fit of 0.5 z^1.5: prints the parameters and how many of the three functions it calls were loaded."""


ADVICE = (
    f"numba {numba.__version__} has changed what fitters/compiled.py relies on (see its docstring):"
    " adapt it there and here, or lower numba's upper bound in pyproject.toml"
)


def test_numba_has_what_the_cache_relies_on():
    """Asked for code before it is compiled, given it after; and code can be taken apart and put together again."""
    asked = []

    class Spy(NullCache):
        def load_overload(self, signature, target_context):
            asked.append(("load", signature))
            assert callable(target_context.refresh), ADVICE
            assert target_context.codegen().magic_tuple(), ADVICE

        def save_overload(self, signature, result):
            asked.append(("save", signature))
            assert result.library.has_dynamic_globals is False, ADVICE
            assert result.codegen.magic_tuple(), ADVICE
            parts = pickle.loads(dumps(result._reduce()))
            again = CompileResult._rebuild(result.target_context, *parts)
            assert again.signature == result.signature, ADVICE

    doubled = numba.njit(lambda x: 2 * x)
    assert hasattr(doubled, "_cache"), ADVICE
    doubled._cache = Spy()
    assert doubled(1.5) == 3.0
    tripled = CFunc(lambda x: 3 * x, ((numba.float64,), numba.float64), locals={}, options={})
    assert hasattr(tripled, "_cache"), ADVICE
    tripled._cache = Spy()
    tripled.compile()
    assert tripled.ctypes(1.5) == 4.5
    assert [kind for kind, _ in asked] == ["load", "save", "load", "save"], ADVICE


def start(script, folder):
    environment = os.environ | {"GPSEARCH_CACHE": str(folder)}
    command = [sys.executable, "-W", "error", "-c", script]
    return subprocess.Popen(command, env=environment, cwd=REPOSITORY, stdout=subprocess.PIPE)


def result(process):
    output, _ = process.communicate()
    assert process.returncode == 0
    return json.loads(output)


def run(script, folder):
    return result(start(script, folder))


@pytest.fixture(scope="module")
def warm(tmp_path_factory):
    """A cache with all that this session has compiled, in its own time or before."""
    warm_up()
    run_scalars(np.zeros((0, 4), np.int32), np.zeros(1))
    folder = tmp_path_factory.mktemp("warm")
    for module in (machine, multistart):
        source = compiled.folder(Path(module.__file__).parent)
        # Another process of this session may be writing a file at this moment.
        shutil.copytree(source, folder / source.name, ignore=shutil.ignore_patterns("*.part"))
    return folder


@pytest.fixture
def copied(warm, tmp_path):
    return Path(shutil.copytree(warm, tmp_path / "cache"))


@pytest.fixture(scope="module")
def scalars(warm):
    """What run_scalars computes, loaded from the good cache."""
    computed, loaded = run(SCALARS, warm)
    assert computed[2:] == pytest.approx([8.0, np.sin(8.0)])
    assert loaded == 1
    return computed


def only(folder, name):
    """The one file that holds the code of a function."""
    (path,) = folder.glob(f"compiled-*/*.{name}-*")
    return path


def truncate(path):
    os.truncate(path, path.stat().st_size // 2)


def empty(path):
    os.truncate(path, 0)


def fill_with_garbage(path):
    path.write_bytes(np.random.default_rng(1).bytes(path.stat().st_size))


def flip_a_bit(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 4
    path.write_bytes(content)


def flip_a_bit_of_the_checksum(path):
    content = bytearray(path.read_bytes())
    content[5] ^= 1
    path.write_bytes(content)


def put_another_function(path):
    shutil.copy(only(path.parents[1], "polish_targets"), path)


def remove(path):
    path.unlink()


DAMAGES = [
    truncate,
    empty,
    fill_with_garbage,
    flip_a_bit,
    flip_a_bit_of_the_checksum,
    put_another_function,
    remove,
]


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_code_is_compiled_and_kept_again(copied, scalars, damage):
    damage(only(copied, "run_scalars"))
    assert run(SCALARS, copied) == [scalars, 0]
    assert run(SCALARS, copied) == [scalars, 1]


@pytest.mark.long
def test_a_fit_survives_damage_to_all_files(copied):
    """Half a minute: everything is compiled again."""
    good, loaded = run(FIT, copied)
    assert good == pytest.approx([0.5, 1.5], rel=1e-3)
    assert loaded == 3
    for number, path in enumerate(sorted(copied.glob("compiled-*/*"))):
        DAMAGES[number % 4](path)
    assert run(FIT, copied) == [good, 0]
    assert run(FIT, copied) == [good, 3]


def test_processes_that_start_at_once_all_compute(tmp_path, scalars):
    processes = [start(SCALARS, tmp_path) for _ in range(3)]
    assert [result(process)[0] for process in processes] == [scalars] * 3
    assert len(list(tmp_path.glob("compiled-*/*"))) == 1
    assert run(SCALARS, tmp_path) == [scalars, 1]


def a_file(folder):
    folder.write_text("in the place of the folder")


def a_file_inside(folder):
    """In the place of the folder that holds the code."""
    folder.mkdir()
    (folder / compiled.folder(Path(machine.__file__).parent).name).write_text("")


def a_folder_inside(folder):
    """In the place of the file that holds the code."""
    run(SCALARS, folder)
    path = only(folder, "run_scalars")
    path.unlink()
    path.mkdir()


def read_only(folder):
    if os.geteuid() == 0:
        pytest.skip("root may write everywhere")
    folder.mkdir(mode=0o500)


@pytest.mark.parametrize("block", [a_file, a_file_inside, a_folder_inside, read_only])
def test_a_folder_that_cannot_be_written_costs_only_the_caching(tmp_path, scalars, block):
    folder = tmp_path / "cache"
    block(folder)
    assert run(SCALARS, folder) == [scalars, 0]
    assert not list(tmp_path.rglob("*.part"))


def test_code_is_kept_by_the_content_of_all_sources(tmp_path):
    sources = [tmp_path / "one", tmp_path / "same", tmp_path / "other"]
    for source, text in zip(sources, ["x = 1", "x = 1", "x = 2"], strict=True):
        source.mkdir()
        (source / "a.py").write_text("")
        (source / "b.py").write_text(text)
    one, same, other = map(compiled.folder, sources)
    assert one == same != other
    assert one.parent == cache.folder()
