"""What the code must not do, since what it reads may be of someone else: turn data into code."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("gpsearch", "workers", "fitters")

PICKLING = {"pickle", "_pickle", "cPickle", "marshal", "shelve", "dill", "cloudpickle", "joblib"}
BUILTINS = {"eval", "exec", "compile", "__import__"}
OF_TEXT = {"sympify", "parse_expr", "parse_latex", "parse_mathematica", "lambdify", "S"}
"""SymPy's ways from a text to Python code that it evaluates; its numbers read a text without."""
YAML_LOADS = {"load", "load_all", "unsafe_load", "unsafe_load_all", "full_load", "full_load_all"}
SHELLS = {"os.system", "os.popen", "subprocess.getoutput", "subprocess.getstatusoutput"}

ALLOWED = {
    # The cache of machine code, in the user's own folder. What is unpickled there is executed in any case, so that
    # whoever can write to the folder gains nothing by a pickle.
    ("fitters/compiled.py", "import of pickle"),
    ("fitters/compiled.py", "call of pickle.loads"),
    # A part of what Dask has just unpickled itself.
    ("workers/dask/task.py", "import of pickle"),
    ("workers/dask/task.py", "call of pickle.loads"),
}


def offences(source: str) -> Iterator[str]:
    """What a module does of all that it must not; aliases of imports are seen through."""
    tree = ast.parse(source)
    names: dict[str, str] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                package = alias.name.partition(".")[0]
                names[alias.asname or package] = alias.name if alias.asname else package
                yield from _of_import(alias.name)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            for alias in node.names:
                names[alias.asname or alias.name] = f"{node.module}.{alias.name}"
            yield from _of_import(node.module)
    for node in ast.walk(tree):
        if isinstance(node, ast.Name | ast.Attribute) and isinstance(node.ctx, ast.Load):
            yield from _of_name(_dotted(node, names))
        if isinstance(node, ast.Call):
            yield from _of_call(node, _dotted(node.func, names))


def _dotted(node: ast.expr, names: dict[str, str]) -> str:
    """`np.load` as `numpy.load`; what is no dotted name begins with a dot."""
    if isinstance(node, ast.Name):
        return names.get(node.id, node.id)
    return f"{_dotted(node.value, names)}.{node.attr}" if isinstance(node, ast.Attribute) else ""


def _of_import(module: str) -> Iterator[str]:
    if module.partition(".")[0] in PICKLING:
        yield f"import of {module}"


def _of_name(name: str) -> Iterator[str]:
    """Mentions count, not only calls: a function may be called by another name."""
    package, _, last = name.rpartition(".")
    if name.removeprefix("builtins.") in BUILTINS:
        yield f"use of {name}"
    if package.partition(".")[0] == "sympy" and last in OF_TEXT:
        yield f"use of {name}"
    if name in SHELLS or (package == "yaml" and last in YAML_LOADS):
        yield f"use of {name}"
    if package == "yaml" and last.endswith("Loader") and last not in ("SafeLoader", "CSafeLoader"):
        yield f"use of {name}"


def _of_call(call: ast.Call, name: str) -> Iterator[str]:
    options = {option.arg: option.value for option in call.keywords}
    if name in ("numpy.load", "numpy.lib.npyio.load") and not _is(options.get("allow_pickle"), False):
        yield f"call of {name} without allow_pickle=False"
    if "shell" in options and not _is(options["shell"], False):
        yield f"call of {name} with a shell"
    if _is(options.get("allow_pickle"), True):
        yield f"call of {name} with allow_pickle"
    if name.endswith((".read_pickle", "pickle.loads", "pickle.load")):
        yield f"call of {name}"


def _is(node: ast.expr | None, value: bool) -> bool:
    return isinstance(node, ast.Constant) and node.value is value


def modules() -> list[Path]:
    return [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]


def test_no_module_turns_data_into_code():
    found = {
        (path.relative_to(ROOT).as_posix(), offence)
        for path in modules()
        for offence in offences(path.read_text())
    }
    assert len(modules()) > 100
    assert found == ALLOWED


@pytest.mark.parametrize(
    ("source", "offence"),
    [
        ("import pickle", "import of pickle"),
        ("from pickle import loads", "import of pickle"),
        ("import cloudpickle.cloudpickle as c", "import of cloudpickle.cloudpickle"),
        ("def f():\n import marshal", "import of marshal"),
        ("eval('1')", "use of eval"),
        ("import builtins as b\nb.exec('1')", "use of builtins.exec"),
        ("list(map(eval, texts))", "use of eval"),
        ("import yaml\nyaml.load(text, yaml.Loader)", "use of yaml.load"),
        ("import yaml\nyaml.load(text, yaml.Loader)", "use of yaml.Loader"),
        ("import yaml\nclass L(yaml.FullLoader): pass", "use of yaml.FullLoader"),
        ("from yaml import unsafe_load as safe_load\nsafe_load(text)", "use of yaml.unsafe_load"),
        ("import numpy as np\nnp.load(path)", "call of numpy.load without allow_pickle=False"),
        ("import numpy as np\nnp.load(path, allow_pickle=x)", "call of numpy.load without allow_pickle=False"),
        ("from numpy import load\nload(path)", "call of numpy.load without allow_pickle=False"),
        ("import sympy as sp\nsp.sympify(text)", "use of sympy.sympify"),
        ("from sympy import S\nS(text)", "use of sympy.S"),
        ("from sympy.parsing.sympy_parser import parse_expr as p\np(text)", "parse_expr"),
        ("import os\nos.system(text)", "use of os.system"),
        ("import subprocess as s\ns.run(text, shell=True)", "call of subprocess.run with a shell"),
    ],
)
def test_the_check_sees_what_it_is_for(source, offence):
    assert any(offence in found for found in offences(source))


@pytest.mark.parametrize(
    "source",
    [
        "import re\nre.compile('a')",
        "import numpy as np\nnp.load(path, allow_pickle=False)",
        "import yaml\nclass L(yaml.SafeLoader): pass",
        "import yaml\nyaml.safe_dump({})",
        "import sympy\nsympy.Integer(3)",
        "compiled.compile()",
    ],
)
def test_the_check_lets_the_rest_pass(source):
    assert list(offences(source)) == []
