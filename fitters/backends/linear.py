"""Which parameters enter an expression linearly, and its split into offset + sum of parameter * coefficient.

The linear ones need no search: for given values of the rest, least squares gives them in closed form (variable
projection, Golub and Pereyra 1973). Products of parameters, as k_s R_0, make sets that are only jointly linear.
"""

from itertools import combinations

from fitters.expressions.lowered import Lowered
from fitters.expressions.operators import OPERATORS, Linear

MAX_LINEAR = 4
"""The bounded least squares of the simplex enumerates the active sets: 3^4 is where that stops being cheap."""

Affine = dict[str | None, int]
"""Nodes of the coefficients by parameter; the offset under None. What is absent is zero."""


def split_linear(form: Lowered, root: int) -> Affine:
    """The split over the largest set of jointly linear parameters; the first such set in order of number.

    New nodes are added to `form`. With no linear parameter the result is `{None: root}`.
    """
    nodes = form.reachable([root])
    alone, conflicts = _linear_alone(form, nodes)
    alone.sort(key=lambda name: int(name[1:]))
    # A set is jointly linear where each pair of it is: only a product of two parts tells them from one.
    for count in range(min(len(alone), MAX_LINEAR), 0, -1):
        for chosen in combinations(alone, count):
            if not any(frozenset(pair) in conflicts for pair in combinations(chosen, 2)):
                split = _affine(form, root, set(chosen))
                assert split is not None
                return split
    return {None: root}


def _linear_alone(form: Lowered, nodes: list[int]) -> tuple[list[str], set[frozenset[str]]]:
    """The parameters in which the last node is affine while the rest is held, and which pairs of them multiply."""
    seen: dict[int, frozenset[str]] = {}
    curved: dict[int, frozenset[str]] = {}
    conflicts: set[frozenset[str]] = set()
    nothing: frozenset[str] = frozenset()
    for node in nodes:
        operator, children = form.nodes[node][0], form.children(node)
        if operator == "param":
            seen[node], curved[node] = frozenset((form.nodes[node][1],)), nothing
            continue
        seen[node] = nothing.union(*(seen[child] for child in children))
        curved[node] = nothing.union(*(curved[child] for child in children))
        linear = OPERATORS[operator].linear if children else Linear.ALL
        if linear is Linear.EACH:
            left, right = (seen[child] for child in children)
            curved[node] |= left & right
            conflicts |= {frozenset((a, b)) for a in left for b in right if a != b}
        elif linear is Linear.FIRST:
            curved[node] |= seen[children[1]]
        elif linear is Linear.NONE:
            curved[node] = seen[node]
    last = nodes[-1]
    return list(seen[last] - curved[last]), conflicts


def _affine(form: Lowered, root: int, chosen: set[str]) -> Affine | None:
    """The root as an affine function of the chosen parameters, None where it is not one."""
    known: dict[int, Affine | None] = {}
    for node in form.reachable([root]):
        known[node] = _affine_of(form, node, chosen, known)
    return known[root]


def _affine_of(form: Lowered, node: int, chosen: set[str], known: dict[int, Affine | None]) -> Affine | None:
    operator = form.nodes[node][0]
    if operator == "param" and form.nodes[node][1] in chosen:
        return {form.nodes[node][1]: form.const(1.0)}
    children = form.children(node)
    parts = [known[child] for child in children]
    if any(part is None for part in parts):
        return None
    free = [set(part) <= {None} for part in parts if part is not None]
    if all(free):
        return {None: node}
    linear = OPERATORS[operator].linear
    if linear is Linear.ALL and len(children) == 1:
        return {name: form.emit(operator, term) for name, term in (parts[0] or {}).items()}
    if linear is Linear.ALL:
        return _sum(form, operator, parts[0] or {}, parts[1] or {})
    if linear is Linear.EACH and any(free):
        factor, affine = (children[0], parts[1]) if free[0] else (children[1], parts[0])
        return {name: form.emit(operator, factor, term) for name, term in (affine or {}).items()}
    if linear is Linear.FIRST and free[1]:
        return {name: form.emit(operator, term, children[1]) for name, term in (parts[0] or {}).items()}
    return None


def _sum(form: Lowered, operator: str, left: Affine, right: Affine) -> Affine:
    result = dict(left)
    for name, term in right.items():
        if name in result:
            result[name] = form.emit(operator, result[name], term)
        else:
            result[name] = term if operator == "add" else form.emit("neg", term)
    return result
