"""A formula evaluated by Operon through pyoperon: its interpreter over batches, float32, one thread."""

from collections.abc import Callable, Mapping
from itertools import chain

import numpy as np
import pyoperon

from fitters.expressions import Expression, grammar
from fitters.expressions.evaluation import FEATURES
from fitters.fitting.cells import Cells

_TYPES = {
    "neg": "Sub",
    "sin": "Sin",
    "cos": "Cos",
    "tan": "Tan",
    "exp": "Exp",
    "asin": "Asin",
    "acos": "Acos",
    "atan": "Atan",
    "sqrt": "Sqrt",
    "add": "Add",
    "sub": "Sub",
    "mul": "Mul",
    "div": "Div",
    "pow": "Pow",
}
_COLUMNS = (*FEATURES, "w", "y")


def objective(expression: Expression, parameters: Mapping[str, float], cells: Cells) -> Callable[[], float]:
    """The first target's sum of squares at given parameters, from a tree that is built once.

    Parameters are constants of the tree; weights and measured values are variables, so that residuals are formed
    in the tree. Knows the dots of the catalogue.
    """
    columns = [*(cells.features[feature] for feature in FEATURES), cells.weights[0], cells.targets[0]]
    values = np.asfortranarray(np.stack(columns, axis=1), np.float32)
    dataset, every = pyoperon.Dataset(values), pyoperon.Range(0, len(cells))
    hashes = {_COLUMNS[variable.Index]: variable.Hash for variable in dataset.Variables}
    weighted = [*_postfix(expression, parameters, hashes), _variable(hashes["w"]), _operator("Mul", 2)]
    tree = pyoperon.Tree([_variable(hashes["y"]), *weighted, _operator("Sub", 2)]).UpdateNodes()
    # Made once: `EvaluateTrees` and an `Evaluate` without it set up threads and a table at every call.
    dispatch = pyoperon.DispatchTable()

    # The data set is a view of `values` and does not keep them alive.
    def evaluate(kept: np.ndarray = values) -> float:
        residuals = pyoperon.Evaluate(dispatch, tree, dataset, every)
        return float(np.einsum("i,i", residuals, residuals))

    return evaluate


def _postfix(node: Expression, parameters: Mapping[str, float], hashes: Mapping[str, int]) -> list[pyoperon.Node]:
    """Operon's order: an operator after its operands, the first operand last."""
    if node.symbol == "dot":
        return [_variable(hashes[grammar.feature(*(child.symbol for child in node.children))])]
    if node.children:
        operands = (_postfix(child, parameters, hashes) for child in reversed(node.children))
        kind = _TYPES.get(node.symbol) or _extremes()[node.symbol]
        return [*chain.from_iterable(operands), _operator(kind, len(node.children))]
    if node.symbol in hashes:
        return [_variable(hashes[node.symbol])]
    constant = pyoperon.Node(pyoperon.NodeType.Constant)
    constant.Value = parameters[node.symbol] if node.symbol in parameters else grammar.value(node.symbol)
    return [constant]


def _variable(key: int) -> pyoperon.Node:
    variable = pyoperon.Node(pyoperon.NodeType.Variable, key)
    variable.Value = 1.0
    return variable


def _operator(kind: str, arity: int) -> pyoperon.Node:
    operator = pyoperon.Node(getattr(pyoperon.NodeType, kind))
    operator.Arity = arity
    return operator


def _extremes() -> dict[str, str]:
    """Which node type is the minimum and which the maximum: release 0.6.2 has the two names exchanged."""
    data = np.zeros((1, 1), np.float32, order="F")
    leaves = []
    for value in (1.0, 2.0):
        leaves.append(pyoperon.Node(pyoperon.NodeType.Constant))
        leaves[-1].Value = value
    tree = pyoperon.Tree([*leaves, _operator("Fmin", 2)]).UpdateNodes()
    lesser = pyoperon.Evaluate(tree, pyoperon.Dataset(data), pyoperon.Range(0, 1))[0]
    return {"min": "Fmin", "max": "Fmax"} if lesser == 1.0 else {"min": "Fmax", "max": "Fmin"}
