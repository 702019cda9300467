"""Random trees over the whole grammar, and random cells to evaluate them on."""

import numpy as np
from hypothesis import strategies as st

from fitters.expressions import Expression, grammar
from fitters.expressions.evaluation import features

UNARY, BINARY, VECTORS = grammar.UNARY, grammar.BINARY, grammar.VECTORS
LEAVES = ("wi.z", "wo.z", "wh.z", "wr.z", "p0", "p1", "p2", "p3", "1", "2", "pi", "4", "0", "5", "0.5", "1e-05")


def random_tree(rng: np.random.Generator, depth: int) -> Expression:
    """A tree of at most `depth` levels; about a fifth of the inner nodes stop early."""
    if depth <= 1 or rng.random() < 0.2:
        if rng.random() < 0.25 and depth > 1:
            return Expression("dot", tuple(Expression(str(v)) for v in rng.choice(VECTORS, 2)))
        return Expression(str(rng.choice(LEAVES)))
    if rng.random() < 0.35:
        return Expression(str(rng.choice(UNARY)), (random_tree(rng, depth - 1),))
    return Expression(str(rng.choice(BINARY)), (random_tree(rng, depth - 1), random_tree(rng, depth - 1)))


def trees(max_leaves: int = 40) -> st.SearchStrategy[Expression]:
    """Trees over the whole grammar, with parameters to p99 and any decimal constant."""
    vectors = st.sampled_from(VECTORS).map(Expression)
    constants = st.floats(0, 1e300).map(_constant)
    parameters = st.integers(0, 99).map(lambda i: Expression(f"p{i}"))
    dots = st.tuples(vectors, vectors).map(lambda pair: Expression("dot", pair))
    leaves = st.one_of(st.sampled_from(LEAVES).map(Expression), parameters, constants, dots)

    def grow(children: st.SearchStrategy[Expression]) -> st.SearchStrategy[Expression]:
        return st.one_of(
            st.builds(lambda symbol, a: Expression(symbol, (a,)), st.sampled_from(UNARY), children),
            st.builds(
                lambda symbol, a, b: Expression(symbol, (a, b)), st.sampled_from(BINARY), children, children
            ),
        )

    return st.recursive(leaves, grow, max_leaves=max_leaves)


def random_directions(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Unit w_i, w_o (count, 3) above the horizon."""
    w = rng.normal(size=(2, count, 3))
    w[..., 2] = np.abs(w[..., 2]) + 1e-3
    w /= np.linalg.norm(w, axis=-1, keepdims=True)
    return w[0], w[1]


def random_features(rng: np.random.Generator, count: int) -> dict[str, np.ndarray]:
    return features(*random_directions(rng, count))


def wild_parameters(rng: np.random.Generator) -> dict[str, float]:
    """p0..p3 of either sign in 1e-6..1e5, now and then 0 or 1: where poles and overflows live."""
    values = 10 ** rng.uniform(-6, 5, 4) * rng.choice([1, 1, 1, -1], 4)
    special = rng.random(4)
    values = np.where(special < 0.08, 0.0, np.where(special < 0.16, 1.0, values))
    return {f"p{i}": float(value) for i, value in enumerate(values)}


def _constant(value: float) -> Expression:
    return Expression(grammar.constant(value))
