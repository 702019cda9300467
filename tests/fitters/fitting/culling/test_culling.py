"""Culling: what does nothing goes, what does something stays, and the stated tolerance is kept."""

from dataclasses import replace
from itertools import pairwise, permutations

import numpy as np
import pytest
import sympy

from fitters.backends.sympy_form import to_sympy
from fitters.expressions import Expression, evaluate, parse, to_text
from fitters.expressions.catalogue import CATALOGUE
from fitters.fitting import (
    ConfirmJob,
    DescriptionJob,
    FitJob,
    FitSettings,
    Problem,
    confirm,
    describe,
)
from fitters.fitting.culling import Culled, CullJob, cull
from fitters.grid import cell_directions

LOBE = "p0 + p1 * pow(wh.z, p2)"
LOBES = (
    {"p0": 0.05, "p1": 0.8, "p2": 20.0},
    {"p0": 0.2, "p1": 0.3, "p2": 5.0},
    {"p0": 0.1, "p1": 0.5, "p2": 60.0},
)
WARD = to_text(CATALOGUE["ward"].expression)
NOISE = 0.1
QUICK = FitSettings(starts=64, restarts=1, rounds=1)


def values_of(text: str, parameters: dict[str, float]):
    return lambda w_i, w_o: evaluate(parse(text), parameters, w_i, w_o)


def noisy(values, seed: int):
    def made(w_i, w_o):
        factors = 1.0 + NOISE * np.random.default_rng(seed).standard_normal(len(w_i))
        return values(w_i, w_o) * factors

    return made


def problem_of(light, material) -> Problem:
    return Problem([material], light, metric="light", cells=600, confirm_cells=1500, seed=1)


@pytest.fixture(scope="module")
def lobe(light, make_material) -> Problem:
    """A material that is the formula `LOBE`, with other parameters in every channel."""
    return problem_of(light, make_material("lobe", *(values_of(LOBE, parameters) for parameters in LOBES)))


@pytest.fixture(scope="module")
def rough(light, make_material) -> Problem:
    """GGX of three roughnesses, measured with noise."""
    ggx = "p0 + p1 * p2 * p2 / pow(wh.z * wh.z * (p2 * p2 - 1) + 1, 2) / sqrt(wi.z + wo.z)"
    channels = [
        noisy(values_of(ggx, {"p0": 0.05, "p1": 0.3, "p2": p2}), i) for i, p2 in enumerate((0.3, 0.5, 0.7))
    ]
    return problem_of(light, make_material("rough", *channels))


def job_of(problem: Problem, text: str, tolerance: float) -> CullJob:
    """A formula fitted and described, ready to be culled; its parameters have the search's bounds."""
    bounds = tuple((f"p{i}", 1e-6, 1e5) for i in range(4))
    job = FitJob((text,), bounds, QUICK)
    return CullJob(job, describe(problem, DescriptionJob(job, confirm(problem, ConfirmJob(job)).fit)), tolerance)


def plain_error(problem: Problem, expression: Expression, found) -> float:
    """|| T (f - m) || / || T m ||, the root mean square over channels, from measurement and light alone."""
    (material,), light = problem.materials, problem.light
    cells = np.flatnonzero((light.lit & material.valid).ravel())
    w_i, w_o = (w[cells] for w in cell_directions())
    squares = []
    for channel in range(3):
        carried = light.table[channel].ravel()[cells].astype(np.float64)
        measured = material.table[channel].ravel()[cells].astype(np.float64)
        values = evaluate(expression, found.parameters(channel), w_i, w_o)
        assert np.isfinite(values).all()
        squares.append(np.sum((carried * (values - measured)) ** 2) / np.sum((carried * measured) ** 2))
    return float(np.sqrt(np.mean(squares)))


def same_but_for_names(one: Expression, other: Expression) -> dict[str, str] | None:
    """The names that make one formula the other, as SymPy can show; None where there are none."""
    for names in permutations(one.parameters):
        renamed = {
            sympy.Symbol(old, real=True): sympy.Symbol(new) for old, new in zip(one.parameters, names, strict=True)
        }
        wanted = {sympy.Symbol(name, real=True): sympy.Symbol(name) for name in names}
        difference = to_sympy(one).subs(renamed, simultaneous=True) - to_sympy(other).subs(wanted)
        if sympy.simplify(difference) == 0:
            return dict(zip(one.parameters, names, strict=True))
    return None


PLANTED = [
    "p0 + p1 * pow(wh.z, p2) * pow(wo.z + 2, p3)",
    f"max({LOBE}, 1e-05)",
    "p0 / pi + 2 * p1 * (pow(dot(wn, wh), p2) / (4 * pi))",
    "p0 + p1 * pow(wh.z, p2 * (p3 + 1))",
    "p0 + p1 * p3 * exp(-exp(-(4 + wi.z) * 4)) * pow(wh.z, p2)",
]


@pytest.mark.parametrize("planted", PLANTED)
def test_what_was_planted_goes_and_the_formula_is_left(lobe, planted):
    culled = cull(lobe, job_of(lobe, planted, 0.01))
    assert parse(culled.expression).nodes == parse(LOBE).nodes
    assert parse(culled.expression).parameters == ("p0", "p1", "p2")
    names = same_but_for_names(parse(culled.expression), parse(LOBE))
    assert names is not None
    for channel, truth in enumerate(LOBES):
        found = culled.description.fit.parameters(channel)
        assert {new: found[old] for old, new in names.items()} == pytest.approx(truth, rel=1e-4)


def test_a_formula_without_anything_to_spare_stays_as_it_is(lobe):
    assert cull(lobe, job_of(lobe, LOBE, 0.05)) == Culled(LOBE)


@pytest.fixture(scope="module")
def ward(rough) -> tuple[CullJob, Culled]:
    """Ward's formula, and what is left of it for a twentieth of its error."""
    task = job_of(rough, WARD, 0.05)
    return task, cull(rough, task)


def test_the_error_on_all_cells_grows_by_less_than_the_tolerance(rough, ward):
    """By an evaluation with NumPy that shares nothing with the engine. More tolerance leaves less."""
    task, culled = ward
    before = plain_error(rough, parse(WARD), task.description.fit)
    careful = cull(rough, replace(task, tolerance=0.001))
    for left, tolerance in ((culled, 0.05), (careful, 0.001)):
        after = plain_error(rough, parse(left.expression), left.description.fit)
        assert after <= (1.0 + tolerance) * before * (1 + 1e-9)
        assert after == pytest.approx(left.description.fit.error, rel=1e-6)
    nodes = [parse(text).nodes for text in (culled.expression, careful.expression, WARD)]
    assert nodes[0] < nodes[1] < nodes[2]


def test_the_steps_lead_from_the_formula_to_what_is_left(ward):
    _, culled = ward
    sizes = [step.nodes for step in culled.steps]
    errors = [step.error for step in culled.steps]
    assert sizes[0][0] == parse(WARD).nodes
    assert sizes[-1][1] == parse(culled.expression).nodes
    for steps in (sizes, errors):
        assert all(earlier[1] == later[0] for earlier, later in pairwise(steps))
    assert all(after <= before for before, after in sizes)
    assert all(parse(step.before) != parse(step.after) for step in culled.steps)


def test_the_same_again_to_the_last_bit(rough, ward):
    task, culled = ward
    again = cull(rough, task)
    assert (again.expression, again.steps) == (culled.expression, culled.steps)
    assert again.description.fit.values.tobytes() == culled.description.fit.values.tobytes()


def test_what_was_culled_once_is_not_culled_again(lobe):
    culled = cull(lobe, job_of(lobe, PLANTED[2], 0.01))
    assert culled.steps
    assert cull(lobe, job_of(lobe, culled.expression, 0.01)) == Culled(culled.expression)


def test_a_parameter_that_is_the_same_everywhere_becomes_a_number(light, make_material):
    channels = [values_of(LOBE, parameters | {"p2": 20.0}) for parameters in LOBES]
    problem = problem_of(light, make_material("equal", *channels))
    culled = cull(problem, job_of(problem, LOBE, 0.01))
    assert culled.expression == "p0 + p1 * pow(wh.z, 20)"
    assert [(step.what, step.before, step.after) for step in culled.steps] == [("parameter dropped", "p2", "20")]


def test_a_number_is_rounded_where_that_costs_nothing(light, make_material):
    text = "p0 + p1 * pow(wh.z, {})"

    def made(exponent: float) -> Problem:
        truth = text.format(exponent)
        channels = [noisy(values_of(truth, parameters), i) for i, parameters in enumerate(LOBES)]
        return problem_of(light, make_material(f"exponent {exponent}", *channels))

    culled = cull(made(20), job_of(made(20), text.format(20.0004), 0.01))
    assert culled.expression == text.format(20)
    assert [(step.what, step.before, step.after) for step in culled.steps] == [
        ("constant snapped", "20.0004", "20")
    ]
    # Here it costs a little, which the tolerance would allow, but saves nothing.
    assert cull(made(17.4), job_of(made(17.4), text.format(17.4), 0.02)) == Culled(text.format(17.4))


def test_parameters_are_numbered_without_gaps(lobe):
    culled = cull(lobe, job_of(lobe, "p1 + p0 * p2 * pow(wh.z, p3)", 0.01))
    assert parse(culled.expression).parameters == ("p0", "p1", "p2")
    assert culled.description.fit.names == ("p0", "p1", "p2")


def errors_of(problem: Problem, *texts: str) -> list[float]:
    return [job_of(problem, text, 0.0).description.fit.error for text in texts]


def test_a_reciprocal_formula_stays_reciprocal(light, make_material):
    """Of w_i.z w_o.z either factor could go within the tolerance, but not both."""
    reciprocal, one_sided, constant = "p0 + p1 * wi.z * wo.z", "p0 + p1 * wi.z", "p0"
    channels = [noisy(values_of(reciprocal, {"p0": 0.1, "p1": p1}), i) for i, p1 in enumerate((0.5, 1.0, 2.0))]
    problem = problem_of(light, make_material("two-sided", *channels))
    whole, one, none = errors_of(problem, reciprocal, one_sided, constant)
    tolerance = 1.1 * one / whole - 1.0
    assert one < (1.0 + tolerance) * whole < none
    culled = cull(problem, job_of(problem, reciprocal, tolerance))
    assert {"wi.z", "wo.z"} <= {node.symbol for node in parse(culled.expression).walk()}
    # One that never was reciprocal has nothing to lose.
    lopsided = job_of(problem, "p0 + p1 * wi.z * wo.z * (1 + 0.01 * wi.z)", tolerance)
    assert cull(problem, lopsided).description.checks.reciprocity > 0.1


def test_a_formula_that_is_nowhere_negative_stays_so(light, make_material):
    clamped, free = "max(0, p0 * (wi.z - p1))", "p0 * (wi.z - p1)"
    channels = [noisy(values_of(clamped, {"p0": p0, "p1": 0.2}), i) for i, p0 in enumerate((0.5, 1.0, 2.0))]
    problem = problem_of(light, make_material("clamped", *channels))
    whole, without = errors_of(problem, clamped, free)
    tolerance = 1.1 * without / whole - 1.0
    assert job_of(problem, free, tolerance).description.checks.minimum < 0
    culled = cull(problem, job_of(problem, clamped, tolerance))
    assert (culled.description or job_of(problem, clamped, 0.0).description).checks.minimum >= 0


def test_a_formula_without_a_fit_stays_as_it_is(lobe):
    task = job_of(lobe, LOBE, 0.01)
    broken = replace(task.description.fit, error=np.inf)
    assert cull(lobe, replace(task, description=replace(task.description, fit=broken))) == Culled(LOBE)
