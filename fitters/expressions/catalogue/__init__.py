"""Published BRDFs in the text form: where a search starts, what its codebank holds, and what it must beat.

Notation: `wi.z`, `wo.z`, `wh.z` are N.L, N.V, N.H; `dot(wo, wh)` is V.H; delta, the angle between N and H, is
`acos(wh.z)`. Values are sr^-1. A parameter's range is what a fit may use, wide enough for every MERL material.
"""

import difflib

from fitters.errors import FittersError
from fitters.expressions.catalogue import classic, disney, genbrdf, glossy
from fitters.expressions.catalogue.published import Formula, Parameter
from fitters.expressions.text import parse

__all__ = ["CATALOGUE", "Formula", "Parameter", "formula"]

_ENTRIES = (*classic.ENTRIES, *genbrdf.ENTRIES, *glossy.ENTRIES, *disney.ENTRIES)

CATALOGUE = {
    name: Formula(name, year, source, parse(text), parameters) for name, year, source, text, parameters in _ENTRIES
}


def formula(name: str) -> Formula:
    """The catalogue's formula of that name. Raises `FittersError` with the nearest name."""
    if name not in CATALOGUE:
        near = difflib.get_close_matches(name, CATALOGUE, 1)
        hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(CATALOGUE)}"
        raise FittersError(f"no formula {name!r} in the catalogue: {hint}")
    return CATALOGUE[name]
