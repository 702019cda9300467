"""The text form: printing and parsing are inverse, and no input does worse than a `FittersError`."""

import contextlib
import pickle
import subprocess
import sys
import time

import numpy as np
import pytest
from hypothesis import given, settings

from fitters.errors import FittersError
from fitters.expressions import Expression, parse, to_text
from fitters.expressions.catalogue import CATALOGUE
from fitters.expressions.expression import MAX_DEPTH
from tests.random_expressions import BINARY, UNARY, random_tree, trees


@settings(max_examples=300, deadline=None)
@given(trees())
def test_parsing_undoes_printing(tree):
    again = parse(to_text(tree))
    assert again == tree
    assert hash(again) == hash(tree)
    assert to_text(again) == to_text(tree)


@pytest.mark.parametrize("symbol", [*UNARY, *BINARY])
@pytest.mark.parametrize("side", [0, 1])
def test_parsing_undoes_printing_to_the_deepest_tree(symbol, side):
    tree = Expression("p0")
    while tree.depth < MAX_DEPTH:
        children = (tree,) if symbol in UNARY else (tree, Expression("2"))
        tree = Expression(symbol, children if side == 0 else children[::-1])
    assert parse(to_text(tree)) == tree
    with pytest.raises(FittersError, match="deep"):
        Expression("sin", (tree,))


def test_parsing_undoes_printing_of_deep_mixtures():
    rng = np.random.default_rng(1)
    for _ in range(100):
        tree = random_tree(rng, 3)
        while tree.depth < MAX_DEPTH:
            symbol = str(rng.choice(["neg", "add", "sub", "mul", "div", "neg", "max"]))
            children = (tree,) if symbol == "neg" else (tree, Expression("wh.z"))
            tree = Expression(symbol, children if rng.random() < 0.5 else children[::-1])
        assert parse(to_text(tree)) == tree


def test_precedence_and_associativity():
    p, q, r = (Expression(f"p{i}") for i in range(3))
    assert parse("p0 - p1 - p2") == Expression("sub", (Expression("sub", (p, q)), r))
    assert parse("p0 + p1 * p2") == Expression("add", (p, Expression("mul", (q, r))))
    assert parse("p0 / (p1 / p2)") == Expression("div", (p, Expression("div", (q, r))))
    assert parse("-p0 * p1") == Expression("mul", (Expression("neg", (p,)), q))
    assert parse(" ( (p0) ) ") == p
    assert parse("p0 * -p1") == Expression("mul", (p, Expression("neg", (q,))))
    assert parse("2.50") == parse("2.5") == parse("25e-1") == Expression("2.5")


def test_printing_uses_no_superfluous_parentheses():
    for text in ("p0 - (p1 - p2)", "(p0 + p1) * p2", "-(p0 * p1)", "-p0 / pi", "p0 * p1 / p2", "--p0"):
        assert to_text(parse(text)) == text


HOSTILE = {
    "python": "__import__('os').system('true')",
    "attribute": "p0.__class__",
    "lambda": "(lambda: 1)()",
    "ten megabytes": "1+" * 5_000_000 + "1",
    "parentheses": "(" * 100_000,
    "parentheses below the length limit": "(" * 40_000 + "p0" + ")" * 9_000,
    "balanced parentheses": "(" * 20_000 + "p0" + ")" * 20_000,
    "minus": "-" * 49_000 + "p0",
    "functions": "sin(" * 9_000 + "p0",
    "pairs": "max(1," * 8_000 + "p0",
    "minus and parentheses": "-(" * 20_000 + "p0",
    "sum": "p0" + "+p0" * 10_000,
    "right operands": "p0" + "-(p0" * 10_000,
    "null": "p0\0",
    "unicode digit": "٣ + 1",
    "superscript": "p0²",
    "unicode parameter": "p٣",
    "unicode name": "πp0",
    "no-break space": "p0\u00a0+ 1",
    "surrogate": "\ud800",
    "infinity": "1e999",
    "long number": "9" * 49_000,
    "not a number": "nan",
    "underscore": "1_000",
    "hexadecimal": "0x10",
    "power operator": "p0 ** 2",
    "empty": "",
    "blank": " \n\t ",
    "vector": "wi",
    "vector operand": "wi + wo",
    "scalar in dot": "dot(p0, wi)",
    "few arguments": "max(p0)",
    "many arguments": "max(p0, 1, 2)",
    "no arguments": "sin()",
    "operator's name": "add(p0, 1)",
    "dangling": "p0 +",
    "two": "p0 p1",
    "closing": "p0)",
    "comma": "p0, p1",
    "semicolon": "p0; p1",
    "long name": "a" * 49_000,
}


@pytest.mark.parametrize("text", HOSTILE.values(), ids=HOSTILE.keys())
def test_hostile_text_is_refused_at_once_with_a_short_message(text):
    start = time.perf_counter()
    with pytest.raises(FittersError) as caught:
        parse(text)
    # A bound against blow-up, generous against a slow machine.
    assert time.perf_counter() - start < 2
    assert 0 < len(str(caught.value)) < 500


@settings(max_examples=300, deadline=None)
@given(trees(8), trees(8))
def test_damaged_text_parses_or_raises_a_fitters_error(first, second):
    a, b = to_text(first), to_text(second)
    for damaged in (a[: len(a) // 2] + b[len(b) // 2 :], a[1:], a[:-1], a + b, a.replace("(", "", 1)):
        with contextlib.suppress(FittersError):
            parse(damaged)


def test_errors_name_the_place():
    with pytest.raises(FittersError, match=r"character 6 .*found 'q'"):
        parse("p0 + q")
    with pytest.raises(FittersError, match=r"expected '\)' at character 7 .*the end"):
        parse("sin(p0")


def test_an_expression_survives_pickling_into_another_process():
    """String hashes differ between processes: an expression must be found in a dictionary there all the same."""
    code = (
        "import pickle, sys; from fitters.expressions import parse;"
        "e = pickle.load(sys.stdin.buffer); f = parse('p0 * wh.z + 1');"
        "assert e == f and {f: 1}[e] == 1 and e.nodes == 5 and e.depth == 3"
    )
    data = pickle.dumps(parse("p0 * wh.z + 1"))
    subprocess.run([sys.executable, "-c", code], input=data, check=True)


def test_an_expression_states_its_parameters_in_order():
    assert parse("p10 + p2 * p0 - p2").parameters == ("p0", "p2", "p10")
    assert all(formula.expression.parameters[0] == "p0" for formula in CATALOGUE.values())
