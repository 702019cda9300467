"""The grammar is Figure 4 of the genBRDF paper, listed here from the paper."""

import pytest

from fitters.errors import FittersError
from fitters.expressions import Expression, grammar, parse

FIGURE_4 = {
    "unary": {"neg", "sin", "cos", "tan", "exp", "asin", "acos", "atan", "sqrt"},
    "binary": {"add", "sub", "mul", "div", "max", "min", "pow"},
    "vector": {"wi", "wo", "wh", "wr", "wn"},
    "component": {"wi.z", "wo.z", "wh.z", "wr.z"},
    "constant": {"1", "2", "pi", "4"},
    "parameter": {"p0", "p1", "p2", "p3"},
    "dot": {"dot"},
}


def test_the_listed_symbols_are_those_of_figure_4():
    assert set(grammar.UNARY) == FIGURE_4["unary"]
    assert set(grammar.BINARY) == FIGURE_4["binary"]
    assert set(grammar.VECTORS) == FIGURE_4["vector"]
    assert set(grammar.COMPONENTS) == FIGURE_4["component"]
    assert set(grammar.CONSTANTS) == FIGURE_4["constant"]
    assert [len(listed) for listed in (grammar.UNARY, grammar.BINARY, grammar.VECTORS)] == [9, 7, 5]


@pytest.mark.parametrize(("kind", "symbols"), FIGURE_4.items())
def test_every_symbol_has_its_kind_and_arity(kind, symbols):
    for symbol in symbols:
        assert grammar.kind(symbol) == kind
        assert grammar.arity(symbol) == {"unary": 1, "binary": 2, "dot": 2}.get(kind, 0)


NO_SYMBOLS = "x p p00 p01 p100 P0 wn.z wi.x wi.y log abs cross + - 1.0 01 +1 -1 1e5 1E5 1_000 inf nan 0x1 ² ٣ p٣"


@pytest.mark.parametrize("symbol", [*NO_SYMBOLS.split(), "", " ", "1 ", "p0\n", "pi\0"])
def test_nothing_else_is_a_symbol(symbol):
    assert grammar.kind(symbol) == ""
    with pytest.raises(FittersError):
        Expression(symbol)


def test_a_constant_has_one_symbol():
    for value, symbol in ((2.0, "2"), (0.5, "0.5"), (1e-5, "1e-05"), (3.141592653589793, "pi"), (0.0, "0")):
        assert grammar.constant(value) == symbol
        assert grammar.value(symbol) == value
    for value in (-1.0, float("inf"), float("nan")):
        with pytest.raises(ValueError, match="constant"):
            grammar.constant(value)


def test_children_must_fit():
    p, w = Expression("p0"), Expression("wi")
    for symbol, children in (
        ("sin", ()),
        ("sin", (p, p)),
        ("add", (p,)),
        ("dot", (p, p)),
        ("dot", (w, p)),
        ("sin", (w,)),
        ("add", (p, w)),
        ("p0", (p,)),
        ("wi", (w,)),
    ):
        with pytest.raises(FittersError):
            Expression(symbol, children)


def test_size_counts_every_operator_constant_parameter_component_and_vector():
    for text, nodes in (
        ("wh.z", 1),
        ("p0", 1),
        ("pi", 1),
        ("dot(wo, wh)", 3),
        ("-p0", 2),
        ("p0 / pi", 3),
        ("pow(1 - dot(wo, wh), 5)", 7),
    ):
        assert parse(text).nodes == nodes
        assert len(list(parse(text).walk())) == nodes
