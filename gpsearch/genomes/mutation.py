"""Random edits, and the codebank that they insert from (genBRDF paper, section 3.3)."""

from bisect import bisect
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fitters.expressions import Expression, grammar, to_text
from fitters.expressions.expression import MAX_DEPTH
from gpsearch.genomes.edits import Delete, Draft, Edit, Insert, Replace, Swap, parsed, replacement_kind

TRIES = 50


def codebank(formulas: Iterable[Expression], parameters: int) -> tuple[str, ...]:
    """Every distinct subexpression of the formulas that is no vector, in text form, smallest first.

    Parameter i becomes parameter i modulo `parameters`.
    """
    nodes = {
        wrap_parameters(node, parameters) for formula in formulas for node in formula.walk() if not node.is_vector
    }
    return tuple(to_text(node) for node in sorted(nodes, key=lambda node: (node.nodes, to_text(node))))


def wrap_parameters(node: Expression, parameters: int) -> Expression:
    """The expression with parameter i renamed to i modulo `parameters`."""
    symbol = node.symbol
    if grammar.is_parameter(symbol):
        symbol = f"p{int(symbol[1:]) % parameters}"
    return Expression(symbol, tuple(wrap_parameters(child, parameters) for child in node.children))


@dataclass(frozen=True)
class Mutation:
    """The settings of random edits.

    codebank:    subexpressions in text form, not empty
    max_nodes:   of an expression
    parameters:  p0 to p{parameters - 1} may occur
    frequencies: relative, of swap, insert, replace and delete
    """

    codebank: tuple[str, ...]
    max_nodes: int
    parameters: int
    frequencies: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)

    @cached_property
    def shares(self) -> tuple[float, ...]:
        """The frequencies as cumulative shares; the last is 1."""
        shares = np.cumsum(np.array(self.frequencies) / sum(self.frequencies))
        return tuple((shares / shares[-1]).tolist())

    @cached_property
    def symbols(self) -> dict[str, tuple[str, ...]]:
        """The symbols that Replace draws from, by `replacement_kind`."""
        scalars = tuple(f"p{i}" for i in range(self.parameters)) + grammar.CONSTANTS + grammar.COMPONENTS
        return {
            "unary": grammar.UNARY,
            "binary": grammar.BINARY,
            "vector": grammar.VECTORS,
            "scalar": scalars,
        }


def random_edit(draft: Draft, mutation: Mutation, rng: np.random.Generator) -> Edit:
    """An edit of a random kind at random nodes that would change the draft and keep it within its limits.

    Does not apply the edit. After `TRIES` draws that are not allowed it deletes the root, which always is.
    """
    label = rng.bytes(6).hex()
    makers = (_swap, _insert, _replace, _delete)
    for _ in range(TRIES):
        edit = makers[bisect(mutation.shares, rng.random())](draft, mutation, rng, label)
        if edit is not None:
            return edit
    return Delete(draft.root, label)


def _pick(choices: list[str] | tuple[str, ...], rng: np.random.Generator) -> str:
    return choices[int(rng.integers(len(choices)))]


def _numbers(draft: Draft) -> list[str]:
    return [label for label in draft.symbols if draft.is_number(label)]


def _swap(draft: Draft, mutation: Mutation, rng: np.random.Generator, label: str) -> Edit | None:
    numbers = _numbers(draft)
    first, second = _pick(numbers, rng), _pick(numbers, rng)
    if draft.inside(first, second) or draft.inside(second, first):
        return None
    one, other = draft.expression(first), draft.expression(second)
    too_deep = max(draft.level(first) + other.depth, draft.level(second) + one.depth) > MAX_DEPTH
    return None if too_deep or one == other else Swap(first, second)


def _insert(draft: Draft, mutation: Mutation, rng: np.random.Generator, label: str) -> Edit | None:
    at, text = _pick(_numbers(draft), rng), _pick(mutation.codebank, rng)
    new, old = parsed(text), draft.expression(at)
    too_large = len(draft.symbols) - old.nodes + new.nodes > mutation.max_nodes
    too_deep = draft.level(at) + new.depth > MAX_DEPTH
    return None if too_large or too_deep or new == old else Insert(at, text, label)


def _replace(draft: Draft, mutation: Mutation, rng: np.random.Generator, label: str) -> Edit | None:
    at = _pick(list(draft.symbols), rng)
    similar = mutation.symbols.get(replacement_kind(draft.symbols[at]), ())
    others = [symbol for symbol in similar if symbol != draft.symbols[at]]
    return Replace(at, _pick(others, rng)) if others else None


def _delete(draft: Draft, mutation: Mutation, rng: np.random.Generator, label: str) -> Edit | None:
    at = _pick(_numbers(draft), rng)
    return None if at == draft.root or draft.symbols[at] == "1" else Delete(at, label)
