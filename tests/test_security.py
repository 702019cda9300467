"""What the code must not do, since what it reads may be of someone else: turn data into code.

The S rules of ruff and the banned names in pyproject.toml see to most of it. The rest is checked here.
"""

import ast
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("gpsearch", "workers", "fitters")
BUILTINS = {"eval", "exec", "compile", "__import__"}

BANNED = """\
import pickle
from pickle import loads
import cloudpickle.cloudpickle as c
import marshal, shelve, dill, joblib
eval("1")
import builtins as b; b.exec("1")
import yaml; yaml.load(text, yaml.Loader)
class L(yaml.FullLoader): pass
from yaml import unsafe_load as safe_load
import sympy as sp; sp.sympify(text)
from sympy import S
from sympy.parsing.sympy_parser import parse_expr as p
import os; os.system(text)
import subprocess as s; s.run(text, shell=True)
s.getoutput(text)
"""
"""Each line is refused."""

ALLOWED = """\
import re; re.compile("a")
import yaml; yaml.safe_load("a")
class L(yaml.SafeLoader): pass
import sympy; sympy.Integer(3)
compiled.compile()
"""


def refused_lines(source: str) -> set[int]:
    """The lines that ruff's security rules refuse in a module of the product, by this project's settings."""
    command = [sys.executable, "-m", "ruff", "check", "--output-format", "json"]
    command += ["--stdin-filename", "gpsearch/a.py", "-"]
    result = subprocess.run(command, input=source, capture_output=True, text=True, check=False, cwd=ROOT)
    found = json.loads(result.stdout)
    return {one["location"]["row"] for one in found if one["code"].startswith("S") or one["code"] == "TID251"}


def test_the_linter_refuses_what_turns_data_into_code():
    assert refused_lines(BANNED) == set(range(1, len(BANNED.splitlines()) + 1))


def test_the_linter_lets_the_rest_pass():
    assert refused_lines(ALLOWED) == set()


def offences(source: str) -> Iterator[str]:
    """What the linter does not see: builtins that are mentioned, not called, and arrays that may hold pickles."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Name) and node.id in BUILTINS:
            yield f"use of {node.id}"
        if isinstance(node, ast.ImportFrom) and node.module == "numpy" and "load" in {a.name for a in node.names}:
            yield "load is imported from numpy: write np.load"
        if isinstance(node, ast.Call) and ast.unparse(node.func) in ("np.load", "numpy.load"):
            options = {option.arg: ast.unparse(option.value) for option in node.keywords}
            if options.get("allow_pickle") != "False":
                yield "np.load without allow_pickle=False"


def test_no_module_turns_data_into_code():
    modules = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
    assert len(modules) > 100
    assert [(path, offence) for path in modules for offence in offences(path.read_text())] == []


@pytest.mark.parametrize(
    "source",
    [
        "list(map(eval, texts))",
        "np.load(path)",
        "numpy.load(path, allow_pickle=x)",
        "np.load(path, allow_pickle=True)",
        "from numpy import load",
    ],
)
def test_the_check_sees_what_it_is_for(source):
    assert list(offences(source))


def test_the_check_lets_the_rest_pass():
    assert list(offences("np.load(path, allow_pickle=False)\nre.compile('a')\ncompiled.compile()")) == []
