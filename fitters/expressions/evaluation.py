"""Plain float64 evaluation with NumPy: the meaning of an expression, which every faster engine must reproduce."""

from collections.abc import Callable, Mapping

import numpy as np

from fitters.expressions import grammar
from fitters.expressions.expression import Expression
from fitters.grid import Array

FUNCTIONS: dict[str, Callable[..., Array]] = {
    "neg": np.negative,
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "exp": np.exp,
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "sqrt": np.sqrt,
    "add": np.add,
    "sub": np.subtract,
    "mul": np.multiply,
    "div": np.divide,
    "max": np.maximum,
    "min": np.minimum,
    "pow": np.power,
}

FEATURES = ("wi.z", "wo.z", "wh.z", "wi.wo", "wi.wh", "wo.wr", "wh.wr")
"""All that the grammar can see of two directions: every dot product and component is one of these, or follows."""


def features(w_i: Array, w_o: Array) -> dict[str, Array]:
    """The `FEATURES` (each (...)) of unit directions w_i, w_o (..., 3); w_r mirrors w_i about the normal."""
    half = w_i + w_o
    half = half / np.linalg.norm(half, axis=-1, keepdims=True)
    mirror = w_i * np.array([-1.0, -1.0, 1.0])

    def dot(a: Array, b: Array) -> Array:
        return np.clip(np.sum(a * b, axis=-1), -1.0, 1.0)

    return {
        "wi.z": w_i[..., 2],
        "wo.z": w_o[..., 2],
        "wh.z": half[..., 2],
        "wi.wo": dot(w_i, w_o),
        "wi.wh": dot(w_i, half),
        "wo.wr": dot(w_o, mirror),
        "wh.wr": dot(half, mirror),
    }


def dot_feature(first: str, second: str) -> str:
    """The feature that a dot product is; `1` for a vector with itself, `2 wi.z^2 - 1` for w_i with w_r."""
    a, b = sorted((first, second))
    if a == b:
        return "1"
    if "wn" in (a, b):
        other = b if a == "wn" else a
        return "wi.z" if other == "wr" else f"{other}.z"
    if (a, b) == ("wi", "wr"):
        return "2 wi.z^2 - 1"
    return {
        ("wi", "wo"): "wi.wo",
        ("wh", "wi"): "wi.wh",
        ("wh", "wo"): "wi.wh",
        ("wo", "wr"): "wo.wr",
        ("wh", "wr"): "wh.wr",
    }[a, b]


def evaluate(expression: Expression, parameters: Mapping[str, Array | float], w_i: Array, w_o: Array) -> Array:
    """BRDF values (...) in sr^-1 at unit directions w_i, w_o (..., 3); not finite where the formula is not.

    `parameters` maps `p0`.. to numbers or arrays that broadcast.
    """
    return evaluate_features(expression, parameters, features(w_i, w_o))


def evaluate_features(
    expression: Expression,
    parameters: Mapping[str, Array | float],
    seen: Mapping[str, Array],
    known: Mapping[Expression, Array] | None = None,
) -> Array:
    """As `evaluate`, for features that are already there, and `known` values of subexpressions on them."""
    shape = np.shape(seen["wi.z"])
    with np.errstate(all="ignore"):
        return np.broadcast_to(_value(expression, parameters, seen, known or {}), shape) + np.zeros(shape)


def parameter_free(expression: Expression, seen: Mapping[str, Array]) -> dict[Expression, Array]:
    """Values of the largest subexpressions that no parameter touches: the same for every target."""
    if not expression.parameters:
        return {expression: evaluate_features(expression, {}, seen)} if expression.children else {}
    found: dict[Expression, Array] = {}
    for child in expression.children:
        found |= parameter_free(child, seen)
    return found


def _value(
    node: Expression,
    parameters: Mapping[str, Array | float],
    seen: Mapping[str, Array],
    known: Mapping[Expression, Array],
) -> Array:
    if node in known:
        return known[node]
    if node.symbol == "dot":
        name = dot_feature(node.children[0].symbol, node.children[1].symbol)
        if name == "1":
            return np.asarray(1.0)
        return seen[name] if name in seen else 2.0 * seen["wi.z"] ** 2 - 1.0
    if node.children:
        return FUNCTIONS[node.symbol](*(_value(child, parameters, seen, known) for child in node.children))
    kind = grammar.kind(node.symbol)
    if kind == "parameter":
        return np.asarray(parameters[node.symbol], dtype=np.float64)
    if kind == "component":
        return seen["wi.z" if node.symbol == "wr.z" else node.symbol]
    return np.asarray(grammar.value(node.symbol))
