"""What is timed computes what the model says: compiled scalar functions against NumPy, call by call."""

import numpy as np
import pytest

from fitters.expressions import evaluate, parse
from fitters.expressions.catalogue import CATALOGUE
from fitters.expressions.evaluation import features
from fitters.grid import SHAPE, cell_directions
from fitters.judging.timing import closure, empty, measure
from fitters.judging.timing.harness import coherent, incoherent
from fitters.materials import load_material
from fitters.models import FormulaModel, MeasuredTable, power_iterations
from fitters.models.factors import BivariateTable, MicrofacetFactors, NaiveFactors
from tests.fitters.backends.interpreter import perturbed
from tests.random_expressions import random_directions, random_tree, wild_parameters

UP = np.array([0.0, 0.0, 1.0])
NO_DIRECTIONS = np.array(
    [[0, 0, -1], [0.6, 0, -0.8], [1, 0, 0], [np.nan, 0, 1], [0, 0, np.nan], [np.inf, 0, 1]], float
)
LARGEST_STRAY = 1e-3
"""Of a value whose last digits of rounding make more than this, nothing can be expected."""


def shown(values):
    """What a model shows: 0 for what is negative or not finite."""
    return np.where(np.isfinite(values) & (values > 0), values, 0.0)


def agrees(tree, rng, count=300):
    """Checks a tree with random parameters of every channel, and says how many values it could compare."""
    w_i, w_o = random_directions(rng, count)
    channels = [wild_parameters(rng) for _ in range(3)]
    return compared(tree, channels, w_i, w_o, rng)


def compared(tree, channels, w_i, w_o, rng):
    model = FormulaModel(tree, np.array([[p[name] for name in tree.parameters] for p in channels]).reshape(3, -1))
    found = closure(model).evaluate(w_i, w_o)
    seen = features(w_i, w_o)
    total = 0
    for channel, parameters in enumerate(channels):
        expected = evaluate(tree, parameters, w_i, w_o)
        # How far rounding may take it: with every operation, and every cosine, off by a little.
        strays = np.zeros(len(w_i))
        steady = np.ones(len(w_i), bool)
        for _ in range(4):
            near = {name: np.clip(v * (1 + 1e-12 * rng.uniform(-1, 1, len(v))), -1, 1) for name, v in seen.items()}
            other = perturbed(tree, parameters, near, rng)
            steady &= np.isfinite(other) == np.isfinite(expected)
            strays = np.fmax(strays, np.abs(shown(other) - shown(expected)))
        well = steady & (strays <= LARGEST_STRAY * np.abs(shown(expected)) + 1e-300)
        error = np.abs(found[:, channel] - shown(expected))
        assert np.all(error[well] <= 10 * strays[well] + 1e-9 * shown(expected)[well]), tree
        total += well.sum()
    return total


@pytest.mark.parametrize("name", CATALOGUE)
def test_published_formulas(name):
    rng = np.random.default_rng(1)
    published = CATALOGUE[name]
    channels = [
        {
            f"p{i}": float(rng.uniform(p.low, min(p.high, 10 * p.low + 1)))
            for i, p in enumerate(published.parameters)
        }
        for _ in range(3)
    ]
    w_i, w_o = random_directions(rng, 1000)
    assert compared(published.expression, channels, w_i, w_o, rng) > 1500


def test_random_expressions():
    rng = np.random.default_rng(2)
    counts = [agrees(random_tree(rng, 7), rng) for _ in range(16)]
    assert sum(counts) > 0.5 * 900 * len(counts)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("-p0", 0.0),
        ("1 / (wh.z - wh.z)", 0.0),
        ("sqrt(0 - wi.z)", 0.0),
        ("max(sqrt(0 - wi.z), p0)", 0.0),
        ("min(p0, sqrt(0 - wi.z))", 0.0),
        ("p0 + pow(0 * wi.z, 0 * p0)", 2.5),
        ("pow(0 - wi.z, 2 * p0 - 1)", 1.0),
        ("p0 + asin(2 * wi.z)", 0.0),
        ("exp(1e5 * wi.z) * p0", 0.0),
        ("p0 + exp(0 - 1e5 * wi.z)", 1.5),
        ("p0 + acos(dot(wi, wh))", 1.5),
        ("p0 + acos(wh.z)", 1.5),
        ("p0", 1.5),
        ("wi.z", 1.0),
        ("2", 2.0),
        ("1 / 0", 0.0),
    ],
)
def test_special_values(text, value):
    """At w_i = w_o = normal and p0 = 1.5: what is not finite or negative is shown as 0, NaN passes max and min."""
    model = FormulaModel(parse(text), np.full((3, len(parse(text).parameters)), 1.5))
    assert closure(model).evaluate(UP[None], UP[None])[0] == pytest.approx([value] * 3)
    assert model.evaluate(UP[None], UP[None])[0] == pytest.approx([value] * 3)


def factors(kind, last):
    rng = np.random.default_rng(3)
    shapes = {"rho_d": (3,), "rho_s": (3,), "D": (90, 3), "F": (90, 3), **last}
    return kind(**{name: rng.random(shape) for name, shape in shapes.items()})


MODELS = {
    "formula": lambda: FormulaModel(parse("p0 / pi + p1 * pow(wh.z, p2)"), np.arange(1.0, 10.0).reshape(3, 3)),
    "bivariate": lambda: BivariateTable(B=np.random.default_rng(4).random((90, 90, 3))),
    "npf-independent-g": lambda: factors(MicrofacetFactors, {"G": (90, 3)}),
    "npf-naive": lambda: factors(NaiveFactors, {"H": (180, 3)}),
    "power-iterations": lambda: power_iterations.extract(load_material("builtin:metal")).model.roughened(1.0, 0.7),
    "power-iterations-anisotropic": lambda: (
        power_iterations.extract_anisotropic(load_material("builtin:metal")).model
    ),
    "measured-table": lambda: MeasuredTable(np.random.default_rng(5).random((3, *SHAPE))),
}


@pytest.fixture(scope="module", params=MODELS)
def model(request):
    return MODELS[request.param]()


def test_every_kind_of_model(model):
    one = closure(model)
    w_i, w_o = random_directions(np.random.default_rng(6), 3000)
    expected = model.evaluate(w_i, w_o)
    assert expected.all()
    np.testing.assert_allclose(one.evaluate(w_i, w_o), expected, rtol=1e-12)
    up = np.tile(UP, (len(NO_DIRECTIONS), 1))
    for pair in ((NO_DIRECTIONS, up), (up, NO_DIRECTIONS)):
        # What was in memory before is overwritten, too.
        assert not one.evaluate(*pair).any()
    assert 0 < one.compile_seconds < np.inf


def test_the_measured_table_is_read_cell_by_cell():
    """At the centres of cells: channel, theta_half, theta_diff and phi_diff each in their place."""
    table = np.random.default_rng(7).random((3, *SHAPE), np.float32)
    w_i, w_o = (w[::211] for w in cell_directions())
    above = (w_i[:, 2] > 0) & (w_o[:, 2] > 0)
    found = closure(MeasuredTable(table)).evaluate(w_i, w_o)
    np.testing.assert_array_equal(found[above], table.reshape(3, -1)[:, ::211].T[above])
    assert above.sum() > 3000
    assert not found[~above].any()


def test_directions_are_unit_and_lit_and_coherent_or_not():
    apart, together = incoherent(4000), coherent(4000)
    steps = []
    for w_i, w_o in (apart, together):
        assert len(w_i) == pytest.approx(4000, rel=0.03)
        for w in (w_i, w_o):
            np.testing.assert_allclose(np.linalg.norm(w, axis=1), 1, atol=1e-12)
            assert np.all(w[:, 2] > 0)
        steps.append(np.median(np.linalg.norm(np.diff(w_i, axis=0), axis=1)))
    # Of a uniform hemisphere the mean of the cosine is a half; a lamp and a viewer stay 45 degrees apart.
    assert apart[0][:, 2].mean() == pytest.approx(0.5, abs=0.02)
    np.testing.assert_allclose(np.sum(together[0] * together[1], axis=1), np.sqrt(0.5), atol=1e-12)
    assert steps[0] > 0.5 > 0.05 > steps[1]


def test_times_are_of_all_and_in_order():
    closures = {"empty": empty(), "lambert": closure(FormulaModel(parse("p0 / pi"), np.ones((3, 1))))}
    found = measure(closures, incoherent(2000), rounds=5)
    assert list(found) == ["empty", "lambert"]
    assert all(0 < timing.low <= timing.ns <= timing.high for timing in found.values())
