"""Which parameters enter an expression linearly, and its split into offset + sum of parameter * coefficient.

The linear ones need no search: for given values of the rest, least squares gives them in closed form (variable
projection, Golub and Pereyra 1973). Products of parameters, as k_s R_0, make sets that are only jointly linear.
"""

from itertools import combinations

from fitters.engine.graph import Graph

MAX_LINEAR = 4
"""The bounded least squares of the simplex enumerates the active sets: 3^4 is where that stops being cheap."""

Affine = dict[str | None, int]
"""Graph nodes of the coefficients by parameter; the offset under None. What is absent is zero."""


def split_linear(graph: Graph, root: int) -> Affine:
    """The split over the largest set of jointly linear parameters; the first such set in order of number.

    New nodes are added to `graph`. With no linear parameter the result is `{None: root}`.
    """
    nodes = graph.reachable([root])
    alone, conflicts = _linear_alone(graph, nodes)
    alone.sort(key=lambda name: int(name[1:]))
    # A set is jointly linear where each pair of it is: only a product of two parts tells them from one.
    for count in range(min(len(alone), MAX_LINEAR), 0, -1):
        for chosen in combinations(alone, count):
            if not any(frozenset(pair) in conflicts for pair in combinations(chosen, 2)):
                split = _affine(graph, root, set(chosen))
                assert split is not None
                return split
    return {None: root}


def _linear_alone(graph: Graph, nodes: list[int]) -> tuple[list[str], set[frozenset[str]]]:
    """The parameters in which the last node is affine while the rest is held, and which pairs of them multiply."""
    seen: dict[int, frozenset[str]] = {}
    curved: dict[int, frozenset[str]] = {}
    conflicts: set[frozenset[str]] = set()
    nothing: frozenset[str] = frozenset()
    for node in nodes:
        operator, children = graph.nodes[node][0], graph.children(node)
        if operator == "param":
            seen[node], curved[node] = frozenset((graph.nodes[node][1],)), nothing
            continue
        seen[node] = nothing.union(*(seen[child] for child in children))
        curved[node] = nothing.union(*(curved[child] for child in children))
        if operator == "mul":
            left, right = (seen[child] for child in children)
            curved[node] |= left & right
            conflicts |= {frozenset((a, b)) for a in left for b in right if a != b}
        elif operator == "div":
            curved[node] |= seen[children[1]]
        elif operator not in ("neg", "add", "sub"):
            curved[node] = seen[node]
    last = nodes[-1]
    return list(seen[last] - curved[last]), conflicts


def _affine(graph: Graph, root: int, chosen: set[str]) -> Affine | None:
    """The root as an affine function of the chosen parameters, None where it is not one."""
    known: dict[int, Affine | None] = {}
    for node in graph.reachable([root]):
        known[node] = _affine_of(graph, node, chosen, known)
    return known[root]


def _affine_of(graph: Graph, node: int, chosen: set[str], known: dict[int, Affine | None]) -> Affine | None:
    operator = graph.nodes[node][0]
    if operator == "param" and graph.nodes[node][1] in chosen:
        return {graph.nodes[node][1]: graph.const(1.0)}
    children = graph.children(node)
    parts = [known[child] for child in children]
    if any(part is None for part in parts):
        return None
    free = [set(part) <= {None} for part in parts if part is not None]
    if all(free):
        return {None: node}
    if operator == "neg":
        return {name: graph.emit("neg", term) for name, term in (parts[0] or {}).items()}
    if operator in ("add", "sub"):
        return _sum(graph, operator, parts[0] or {}, parts[1] or {})
    if operator == "mul" and any(free):
        factor, affine = (children[0], parts[1]) if free[0] else (children[1], parts[0])
        return {name: graph.emit("mul", factor, term) for name, term in (affine or {}).items()}
    if operator == "div" and free[1]:
        return {name: graph.emit("div", term, children[1]) for name, term in (parts[0] or {}).items()}
    return None


def _sum(graph: Graph, operator: str, left: Affine, right: Affine) -> Affine:
    result = dict(left)
    for name, term in right.items():
        if name in result:
            result[name] = graph.emit(operator, result[name], term)
        else:
            result[name] = term if operator == "add" else graph.emit("neg", term)
    return result
