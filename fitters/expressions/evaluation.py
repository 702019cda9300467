"""The NumPy backend in float64: the meaning of an expression, which every other backend must reproduce."""

from collections.abc import Collection, Iterable, Mapping

import numpy as np

from fitters.expressions.expression import Expression
from fitters.expressions.lowered import CELL, CONSTANT, Lowered, Walk, lowered
from fitters.expressions.operators import OPERATORS
from fitters.grid import Array

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


class Evaluator:
    """Nodes of a lowered form computed by NumPy in float64, any number of times.

    roots: the nodes that are wanted; given: those whose values the caller has, see `Walk`
    """

    def __init__(self, form: Lowered, roots: Iterable[int], given: Collection[int] = ()) -> None:
        self._walk = Walk[Array](form, roots, given)

    def run(
        self,
        parameters: Mapping[str, Array | float] | None = None,
        features: Mapping[str, Array] | None = None,
        given: Mapping[int, Array] | None = None,
    ) -> list[Array]:
        """Values of the roots, of whatever shape they broadcast to; not finite where a formula is not."""

        def leaf(kind: str, label: float | str) -> Array:
            if kind == "feature":
                return (features or {})[str(label)]
            return np.asarray((parameters or {})[str(label)] if kind == "param" else label, dtype=np.float64)

        with np.errstate(all="ignore"):
            return self._walk.run(leaf, _operation, given)


def _operation(operator: str, *operands: Array) -> Array:
    return OPERATORS[operator].meaning(*operands)


def evaluate(expression: Expression, parameters: Mapping[str, Array | float], w_i: Array, w_o: Array) -> Array:
    """BRDF values (...) in sr^-1 at unit directions w_i, w_o (..., 3); not finite where the formula is not.

    `parameters` maps `p0`.. to numbers or arrays that broadcast.
    """
    return evaluate_features(expression, parameters, features(w_i, w_o))


def evaluate_features(
    expression: Expression,
    parameters: Mapping[str, Array | float],
    seen: Mapping[str, Array],
    known: Mapping[int, Array] | None = None,
) -> Array:
    """As `evaluate`, for features that are there, and values of `parameter_free` subexpressions on them."""
    form, root = lowered(expression)
    (values,) = Evaluator(form, [root], known or ()).run(parameters, seen, known)
    shape = np.shape(seen["wi.z"])
    return np.broadcast_to(values, shape) + np.zeros(shape)


def parameter_free(expression: Expression, seen: Mapping[str, Array]) -> dict[int, Array]:
    """Values of the largest subexpressions that no parameter touches, by node: the same for every target."""
    form, root = lowered(expression)
    free = (CELL, CONSTANT)
    read = {
        child
        for node, node_class in enumerate(form.classes)
        if node_class not in free
        for child in form.children(node)
    }
    wanted = [node for node in sorted(read | {root}) if form.classes[node] in free and form.children(node)]
    shape = np.shape(seen["wi.z"])
    values = Evaluator(form, wanted).run(features=seen)
    return {
        node: np.broadcast_to(array, shape) + np.zeros(shape) for node, array in zip(wanted, values, strict=True)
    }
