"""Entries that stand for formulas: names of the catalogue, expressions, and groups of the codebank."""

from collections.abc import Callable, Mapping

from pydantic import ValidationInfo

from fitters.errors import FittersError
from fitters.expressions import Expression, parse, to_text
from fitters.expressions.catalogue import CATALOGUE, Formula
from gpsearch.configuration.fields import refuse_at, surroundings
from gpsearch.configuration.wording import listed, nearest, shown

MAX_NODES = 1000
"""The size of the largest expression that a configuration may hold or a search may reach."""
ALL = "all"
GROUPS: Mapping[str, Callable[[Formula], bool]] = {
    ALL: lambda formula: True,
    "published-2013": lambda formula: formula.year <= 2013,
}
"""Codebank entries that stand for formulas of the catalogue: all, or those older than the genBRDF paper."""


def check_formula(entry: str, info: ValidationInfo) -> str:
    """Validates a catalogue name or an expression within the search's limits; an expression in canonical form.

    Limits that are themselves invalid, and so not in `info.data`, are not applied.
    """
    expression = resolve_formula(entry)
    if (parameters := info.data.get("parameters")) is not None:
        beyond = [name for name in expression.parameters if int(name[1:]) >= parameters]
        if beyond:
            may = "only p0" if parameters == 1 else f"p0 to p{parameters - 1}"
            limit = f"search.parameters is {parameters}: {may} may occur"
            raise ValueError(f"{shown(entry)} uses {listed(beyond)}, but {limit}")
    is_start = info.field_name == "start"
    largest = info.data.get("max_nodes", MAX_NODES) if is_start else MAX_NODES
    if expression.nodes > largest:
        limit = "search.max_nodes is" if is_start else "the most is"
        raise ValueError(f"{shown(entry)} has {expression.nodes} nodes, but {limit} {largest}")
    return entry if entry in CATALOGUE else to_text(expression)


def check_codebank(entry: str, info: ValidationInfo) -> str:
    """As `check_formula`; the name of one of `GROUPS` is valid, too."""
    if entry in GROUPS:
        return entry
    if (near := nearest(entry, GROUPS, cutoff=0.8)) and entry not in CATALOGUE:
        raise ValueError(f"{shown(entry)} is no group of the catalogue; did you mean {near}?")
    return check_formula(entry, info)


def check_no_baseline_twice(names: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
    """Validates the list of baselines. A stored run may name a baseline twice."""
    for index, name in enumerate(names):
        if name in names[:index] and surroundings(info).check_files:
            text = f"{shown(name)} is baselines[{names.index(name)}] again; name each baseline once"
            raise refuse_at(index, name, text)
    return names


def resolve_formula(entry: str) -> Expression:
    """The expression of a catalogue name or a text form. Raises `ValueError` with why it is neither."""
    if entry in CATALOGUE:
        return CATALOGUE[entry].expression
    try:
        return parse(entry)
    except FittersError as error:
        near = nearest(entry, CATALOGUE)
        hint = f"did you mean {near}?" if near else f"there are {listed(CATALOGUE)}"
        split = entry.count("(") != entry.count(")")
        quote = "; an expression with a comma needs quotes in [...]" if split else ""
        reason = f"no catalogue name ({hint}) and no expression ({error})"
        raise ValueError(f"{shown(entry)} is {reason}{quote}") from None


def resolve_codebank(entries: tuple[str, ...], parameters: int) -> tuple[Expression, ...]:
    """The formulas that the codebank is made from; of a group those with at most `parameters` parameters."""
    formulas: dict[Expression, None] = {}
    for entry in entries:
        if entry in GROUPS:
            group = (formula.expression for formula in CATALOGUE.values() if GROUPS[entry](formula))
            formulas |= dict.fromkeys(f for f in group if all(int(p[1:]) < parameters for p in f.parameters))
        else:
            formulas[resolve_formula(entry)] = None
    return tuple(formulas)
