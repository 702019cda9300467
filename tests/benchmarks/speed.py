"""What an evaluation of every kind of model costs, and of single functions for scale.

`python -m tests.benchmarks.speed`. One material, fitted by every baseline; formulas with parameters in the middle
of their ranges, which time does not depend on.
"""

import numpy as np

from fitters.expressions import Expression, parse
from fitters.expressions.catalogue import CATALOGUE
from fitters.judging.timing import closure, coherent, empty, incoherent, measure
from fitters.judging.timing.harness import COUNT, ROUNDS
from fitters.materials import load_material
from fitters.models import FormulaModel, MeasuredTable, Model, factors, power_iterations
from tests.benchmarks.table import Table

CALL = "empty call"
FORMULAS = ("lambert", "oren-nayar", "blinn-phong", "ward", "cook-torrance", "ggx", "abc", "sgd")
FUNCTIONS = {
    "wh.z": "wh.z",
    "sqrt": "sqrt(wh.z)",
    "division": "1 / (1 + wh.z)",
    "exp": "exp(wh.z)",
    "pow": "pow(wh.z, wi.z)",
    "sin": "sin(wh.z)",
    "tan": "tan(wh.z)",
    "acos": "acos(wh.z)",
    "atan": "atan(wh.z)",
}
"""Each once for all channels, at the cosine of the half vector."""


def formula(expression: Expression) -> FormulaModel:
    """With parameters that differ between the channels, as fitted ones do."""
    low_high = next(
        (f.bounds.values() for f in CATALOGUE.values() if f.expression == expression),
        [(0.1, 1.0)] * len(expression.parameters),
    )
    middle = np.array([np.sqrt(max(low, 1e-3) * high) for low, high in low_high])
    return FormulaModel(expression, np.array([0.9, 1.0, 1.1])[:, None] * middle)


def models() -> dict[str, Model]:
    material = load_material("builtin:glossy-plastic")
    found: dict[str, Model] = {name: formula(CATALOGUE[name].expression) for name in FORMULAS}
    found["bivariate"] = factors.fit_bivariate(material).model
    found["npf-independent-g"] = factors.fit_independent_g(material, only=("slices",)).model
    found["npf-naive"] = factors.fit_naive(material).model
    found["power-iterations"] = power_iterations.extract(material).model
    found["power-iterations-anisotropic"] = power_iterations.extract_anisotropic(material).model
    found["measured table"] = MeasuredTable(material.table)
    return found | {f"  {name}": formula(parse(text)) for name, text in FUNCTIONS.items()}


def table(every: dict[str, Model], count: int = COUNT, rounds: int = ROUNDS) -> Table:
    """The times of models at `count` pairs of directions."""
    closures = {name: closure(model) for name, model in every.items()} | {CALL: empty()}
    apart, together = measure(closures, incoherent(count), rounds), measure(closures, coherent(count), rounds)
    unit = apart["ggx"].ns - apart[CALL].ns
    rows = [
        (
            name,
            every[name].floats if name in every else None,
            timing.ns,
            f"{timing.low:.1f} to {timing.high:.1f}",
            together[name].ns,
            (timing.ns - apart[CALL].ns) / unit,
            closures[name].compile_seconds,
        )
        for name, timing in apart.items()
    ]
    return Table(
        f"Nanoseconds per evaluation of three channels, {rounds} rounds in turns",
        ("model", "floats", "incoherent", "quartiles", "coherent", "without the call, of ggx", "compiled in s"),
        tuple(rows),
        ("single functions once for all channels, with the half vector that they need",),
    )


def main() -> None:
    print(table(models()).text())


if __name__ == "__main__":
    main()
