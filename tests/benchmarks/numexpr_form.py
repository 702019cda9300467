"""A formula evaluated by numexpr: a virtual machine over blocks, here in float32 on one thread."""

import re
from collections.abc import Callable, Mapping

import numexpr
import numpy as np

from fitters.expressions import Expression, grammar
from fitters.expressions.evaluation import FEATURES
from fitters.fitting.cells import Cells

_SIGNS = {"add": "+", "sub": "-", "mul": "*", "div": "/"}
_CALLS = {"asin": "arcsin", "acos": "arccos", "atan": "arctan"}
_ORDER = {"max": ">", "min": "<"}


def objective(expression: Expression, parameters: Mapping[str, float], cells: Cells) -> Callable[[], float]:
    """The first target's sum of squares at given parameters, compiled once. Knows the dots of the catalogue."""
    names = {feature: f"f{i}" for i, feature in enumerate(FEATURES)}
    values = {names[feature]: cells.features[feature].astype(np.float32) for feature in FEATURES}
    values |= {name: np.array(value, np.float32) for name, value in parameters.items()}
    values |= {"w": cells.weights[0], "y": cells.targets[0]}
    text = f"w * {_rendered(expression, names, values)} - y"
    used = sorted(set(re.findall(r"\w+", text)) & set(values))
    # A signature's Python float is numexpr's float32.
    compiled = numexpr.NumExpr(text, [(name, float) for name in used])
    arguments = [values[name] for name in used]
    numexpr.set_num_threads(1)

    def evaluate() -> float:
        residuals = compiled(*arguments)
        return float(np.einsum("i,i", residuals, residuals))

    return evaluate


def _rendered(node: Expression, names: Mapping[str, str], values: dict[str, np.ndarray]) -> str:
    """A formula's text. Its constants join `values`: a literal would turn the whole formula to float64."""
    if node.symbol == "dot":
        return names[grammar.feature(*(child.symbol for child in node.children))]
    if not node.children:
        return _leaf(node.symbol, names, values)
    children = [_rendered(child, names, values) for child in node.children]
    if node.symbol == "neg":
        return f"(-{children[0]})"
    if node.symbol in _SIGNS:
        return f"({children[0]} {_SIGNS[node.symbol]} {children[1]})"
    if node.symbol in _ORDER:
        first, second = children
        return f"where({first} {_ORDER[node.symbol]} {second}, {first}, {second})"
    if node.symbol == "pow":
        # A whole exponent written out becomes products.
        exponent = node.children[1].symbol
        return f"({children[0]} ** {exponent if exponent.isdigit() else children[1]})"
    return f"{_CALLS.get(node.symbol, node.symbol)}({children[0]})"


def _leaf(symbol: str, names: Mapping[str, str], values: dict[str, np.ndarray]) -> str:
    if symbol in names:
        return names[symbol]
    if grammar.is_parameter(symbol):
        return symbol
    name = f"k{grammar.value(symbol)}".translate(str.maketrans(".-+", "_mp"))
    values[name] = np.array(grammar.value(symbol), np.float32)
    return name
