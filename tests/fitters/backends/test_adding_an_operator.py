"""An operator is one entry: with another one in the table, a backend says it or refuses it by name."""

import numpy as np
import pytest
import sympy

from fitters.backends.latex import to_latex
from fitters.backends.program import lower, lower_whole
from fitters.backends.sympy_form import from_sympy, to_sympy
from fitters.errors import FittersError
from fitters.expressions import evaluate, parse, to_text
from fitters.expressions.canonical import canonical
from fitters.expressions.operators import Operator
from fitters.expressions.simplification import tidy
from fitters.judging.timing.closures import closure
from fitters.models import FormulaModel
from fitters.testing.backends import temporary

UP = np.array([[0.0, 0.0, 1.0]])
MODULUS = Operator(
    "modulus",
    1,
    np.abs,
    non_negative=lambda operands: True,
    sympy="Abs",
    latex=r"\left|{0}\right|",
    llvm="llvm.fabs",
)


@pytest.fixture
def expression():
    with temporary(MODULUS):
        yield parse("modulus(wi.z - p0 * 1) + modulus(0 - 0.5) * 0")


def test_text_canonical_form_and_tidying_know_it(expression):
    assert to_text(expression) == "modulus(wi.z - p0 * 1) + modulus(0 - 0.5) * 0"
    assert to_text(tidy(expression)) == "modulus(wi.z - p0)"
    assert canonical(parse("modulus(0 - 0.5) * p3")).text == "0.5 * p0"


def test_backends_that_the_entry_speaks_to_compute_it(expression):
    assert evaluate(expression, {"p0": 1.2}, UP, UP) == pytest.approx(0.2)
    assert float(to_sympy(expression).subs({"p0": 1.2, "wi.z": 1.0}).subs(symbols(1.2))) == pytest.approx(0.2)
    assert to_text(from_sympy(sympy.Abs(sympy.Symbol("p0", real=True)))) == "modulus(p0)"
    assert to_latex(tidy(expression)) == r"\left|\cos\theta_i - p_{0}\right|"
    model = FormulaModel(expression, np.full((3, 1), 1.2))
    assert closure(model).evaluate(UP, UP)[0] == pytest.approx([0.2] * 3)


@pytest.mark.parametrize("low", [lower, lower_whole])
def test_the_machine_refuses_what_its_table_lacks(expression, low):
    with pytest.raises(FittersError, match="machine lacks modulus"):
        low(expression)
    with pytest.raises(FittersError, match="machine lacks modulus"):
        low(parse("modulus(p0) * wi.z + sin(p0)"))


@pytest.mark.parametrize("backend", ["sympy", "latex", "llvm"])
def test_a_backend_that_the_entry_does_not_speak_to_refuses_it(backend):
    with temporary(Operator("sinh", 1, np.sinh)):
        silent = parse("sinh(p0 * wi.z)")
        prints = {
            "sympy": lambda: to_sympy(silent),
            "latex": lambda: to_latex(silent),
            "llvm": lambda: closure(FormulaModel(silent, np.ones((3, 1)))),
        }
        with pytest.raises(FittersError, match=f"{backend} lacks sinh"):
            prints[backend]()


def symbols(p0):
    return {sympy.Symbol("p0", real=True): p0, sympy.Symbol("wi.z", real=True): 1.0}
