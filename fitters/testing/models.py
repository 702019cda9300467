"""The contract of models: `check_fitter` and `check_model` assert what every entry of `MODELS` must do.

    from fitters.testing.models import check_fitter
    check_fitter(MODELS["ggx"], problem)

`check_model` is for a model of one material alone: it evaluates, samples, is saved, and is timed.
"""

import re
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fitters.errors import FittersError
from fitters.fitting import FitSettings, Problem
from fitters.grid import Array, cell_directions
from fitters.judging.timing import closure
from fitters.models import KINDS, Fitted, Fitter, Model, fitter_of, load
from fitters.testing.sphere import direction, directions, p_value, random_directions

QUICK = FitSettings(starts=16, restarts=1, rounds=1, evaluations=10)
"""How hard a formula is fitted here."""
VIEWS = (5, 45, 75)
"""Degrees of the view from the normal, at which sampled directions are checked."""
SAMPLES = 200_000
LEAST_P_VALUE = 1e-4


def check_fitter(fitter: Fitter, problem: Problem, views: Sequence[float] = VIEWS) -> Fitted:
    """All checks of an entry of `MODELS` on a problem; returns what was fitted.

    Raises `AssertionError` that names the model and what it does wrong.
    """
    check_entry(fitter)
    fitted = fitter.fit(problem, **({"settings": QUICK} if "settings" in fitter.options else {}))
    check_fitted(fitter, fitted, problem)
    check_options(fitter, problem)
    check_file(fitted)
    for material in fitted.materials:
        check_model(fitted[material], views)
    if fitter.baseline and not problem.anisotropic:
        check_stages(fitter, fitted, problem)
    return fitted


def check_model(model: Model, views: Sequence[float] = VIEWS) -> None:
    """All checks of one model of one material."""
    check_values(model)
    check_limits(model)
    check_directions(model)
    check_reciprocity(model)
    check_size(model)
    check_arrays(model)
    check_code(model)
    for degrees in views:
        check_density(model, degrees)
        check_albedo(model, degrees)


def check_entry(fitter: Fitter) -> None:
    """It has a name that a command line takes, is found by it, and charts know its family."""
    assert re.fullmatch(r"[a-z][a-z0-9-]*", fitter.name), f"{fitter.name!r}: use small letters, digits and hyphens"
    assert fitter_of(fitter.name) is fitter, f"{fitter.name}: another model has this name"
    assert KINDS[fitter.model.kind] is fitter.model, (
        f"{fitter.name}: another class has the kind {fitter.model.kind}"
    )
    assert fitter.family.label, f"{fitter.name}: its family has no label for charts"
    assert re.fullmatch("#[0-9a-f]{6}", fitter.family.colour), f"{fitter.name}: the colour is not like #1f5fa8"


def check_fitted(fitter: Fitter, fitted: Fitted, problem: Problem) -> None:
    """Every material has a model of the entry's class, finite errors, and warnings in words."""
    name = fitter.name
    assert fitted.name == name
    assert fitted.materials == problem.names == tuple(fitted.errors), f"{name}: not a model for each material"
    assert all(type(fitted[material]) is fitter.model for material in problem.names), f"{name}: another class"
    assert all(len(errors) == 3 and np.all(np.isfinite(errors)) for errors in fitted.errors.values()), name
    assert fitted.metrics.keys() == problem.metrics.keys(), f"{name}: not an error by every metric"
    assert fitted.error == fitted.metrics[problem.metric.name]
    assert all(isinstance(warning, str) and warning for warning in fitted.warnings), f"{name}: a warning is empty"
    assert all(len(fit.remarks) == 3 for fit in fitted.fits.values()), f"{name}: not a remark for each channel"


def check_options(fitter: Fitter, problem: Problem) -> None:
    """An option that it does not take is refused by name."""
    said = ""
    try:
        fitter.fit(problem, unknown=1)
    except FittersError as error:
        said = str(error)
    assert "unknown" in said, f"{fitter.name}: takes an option that does not exist"


def check_file(fitted: Fitted) -> None:
    """What is saved is equal when it is loaded."""
    with tempfile.TemporaryDirectory() as folder:
        fitted.save(Path(folder) / "fitted.npz")
        loaded = load(Path(folder) / "fitted.npz")
    for name in ("name", "materials", "errors", "metrics", "fit_seconds", "warnings", "parameters"):
        assert getattr(loaded, name) == getattr(fitted, name), f"{fitted.name}: {name} is not as it was saved"
    for material in fitted.materials:
        _assert_equal(loaded[material], fitted[material])


def check_stages(fitter: Fitter, fitted: Fitted, problem: Problem) -> None:
    """The fit in stages, as a search does it, has as many tasks as it says and ends at the same errors."""
    stages, tasks = fitter.stages(len(problem.names), QUICK), 0
    stage = next(stages)
    while True:
        tasks += len(stage.tasks)
        assert stage.label.strip(), f"{fitter.name}: a stage has no label"
        assert stage.seconds > 0, f"{fitter.name}: a stage takes no time"
        try:
            stage = stages.send([stage.function(problem, task) for task in stage.tasks])
        except StopIteration as end:
            baseline = end.value
            break
    assert tasks == fitter.count_tasks(len(problem.names)), f"{fitter.name}: {tasks} tasks, not as many as it says"
    for name, error in fitted.metrics.items():
        assert baseline.metrics[name] == error, f"{fitter.name}: another {name} error in stages"


def check_values(model: Model) -> None:
    """Values are finite, not negative, and 0 below the horizon."""
    w_i, w_o = random_directions(5000, 1, least_cos=-1), random_directions(5000, 2, least_cos=-1)
    values = model.evaluate(w_i, w_o)
    assert values.shape == (5000, 3), f"{model.kind}: values of shape {values.shape}"
    assert np.all(np.isfinite(values)), f"{model.kind}: values that are not finite"
    assert np.all(values >= 0), f"{model.kind}: negative values"
    assert not values[(w_i[:, 2] <= 0) | (w_o[:, 2] <= 0)].any(), f"{model.kind}: light from below the horizon"
    assert values.any(), f"{model.kind}: 0 everywhere"


def check_limits(model: Model) -> None:
    """Grazing, normal, on the horizon: every pair, each with itself (retro-reflection) and with its opposite."""
    theta = np.arccos([1.0, 0.5, 1e-4, 1e-12, 0.0])
    ends = [direction(theta, 0.0), direction(theta, np.pi), direction(theta, 2.0), np.array([[1, 0, 1e-300]])]
    limits = np.concatenate([*ends, *(-end for end in ends)])
    w_i, w_o = np.repeat(limits, len(limits), axis=0), np.tile(limits, (len(limits), 1))
    values, density = model.evaluate(w_i, w_o), model.pdf(w_i, w_o)
    assert np.all(np.isfinite(values) & (values >= 0)), f"{model.kind}: not finite at the ends of the hemisphere"
    assert not values[(w_i[:, 2] <= 0) | (w_o[:, 2] <= 0)].any(), f"{model.kind}: light along the horizon"
    assert np.all(np.isfinite(density) & (density >= 0)), f"{model.kind}: a density that is not finite"


def check_directions(model: Model) -> None:
    """A vector that is not finite has no value; layout and type of arrays do not matter; there may be none."""
    up = np.array([[0.0, 0.0, 1.0]])
    for broken in ([np.nan, 0, 1], [0, np.nan, 1], [0, 0, np.nan], [np.inf, 0, 1]):
        assert not model.evaluate(np.array([broken]), up).any(), f"{model.kind}: a value for {broken}"
        assert not model.evaluate(up, np.array([broken])).any(), f"{model.kind}: a value for {broken}"
    none = np.empty((0, 3))
    assert model.evaluate(none, none).shape == model.sample(none, none).shape == (0, 3)
    assert model.pdf(none, none).shape == (0,)
    w_i, w_o = (w.astype(np.float32) for w in (random_directions(500, 1), random_directions(500, 2)))
    u = np.random.default_rng(3).random((500, 3), np.float32)
    wide = [x.astype(np.float64) for x in (w_i, w_o, u)]
    for one, other, numbers in ((w_i, w_o, u), tuple(np.asfortranarray(x) for x in wide)):
        np.testing.assert_array_equal(model.evaluate(one, other), model.evaluate(*wide[:2]))
        np.testing.assert_array_equal(model.pdf(one, other), model.pdf(*wide[:2]))
        np.testing.assert_array_equal(model.sample(other, numbers), model.sample(wide[1], wide[2]))


def check_reciprocity(model: Model) -> None:
    """It is reciprocal if and only if it says so.

    At centres of bins, turned about the normal: rounding takes no pair into another bin.
    """
    w_i, w_o = (_turned(w[::59]) for w in cell_directions())
    forth, back = model.evaluate(w_i, w_o), model.evaluate(w_o, w_i)
    assert forth.any()
    equal = np.allclose(forth, back, rtol=1e-6, atol=1e-12)
    assert equal is model.reciprocal, f"{model.kind}: says reciprocal = {model.reciprocal}, which it is not"


def check_size(model: Model) -> None:
    """It says how many numbers it stores and what an evaluation takes."""
    assert 0 < model.floats <= sum(values.size for values in model.arrays().values()) or model.expression
    assert model.fit_seconds >= 0
    assert 0 < model.cost_ns() < np.inf


def check_arrays(model: Model) -> None:
    """Its arrays make an equal model."""
    _assert_equal(type(model).from_arrays(model.arrays()), model)


def check_code(model: Model) -> None:
    """Its code for one pair of directions gives the values of `evaluate`."""
    w_i, w_o = random_directions(2000, 5, least_cos=-0.2), random_directions(2000, 6, least_cos=-0.2)
    expected = model.evaluate(w_i, w_o)
    values = closure(model).evaluate(w_i, w_o)
    # The code has its own order of arithmetic: a direction at the edge of a bin may fall into the next one.
    near = np.isclose(values, expected, rtol=1e-6, atol=1e-9).all(axis=1)
    assert np.mean(near) > 0.995, f"{model.kind}: the code differs from evaluate at {np.mean(~near):.1%} of pairs"


def check_density(model: Model, degrees: float) -> None:
    """The density integrates to 1, and sampled directions are unit vectors that have it."""
    w_o = _view(degrees, SAMPLES)
    at, measure = directions(w_o[0])
    density = model.pdf(at, _view(degrees, len(at)))
    total = float(np.sum(density * measure))
    assert np.all(density >= 0), f"{model.kind}: a negative density"
    assert abs(total - 1) < 1e-3, f"{model.kind}: the density at {degrees} degrees integrates to {total}"
    w_i = model.sample(w_o, np.random.default_rng(7).random((SAMPLES, 3)))
    np.testing.assert_allclose(np.linalg.norm(w_i, axis=1), 1, atol=1e-9)
    probability = p_value(model, w_o[0], w_i)
    assert probability > LEAST_P_VALUE, f"{model.kind}: samples at {degrees} degrees do not have the density"


def check_albedo(model: Model, degrees: float) -> None:
    """The albedo by sampling is that by integration."""
    count = SAMPLES // 2
    w_o = _view(degrees, count)
    w_i = model.sample(w_o, np.random.default_rng(3).random((count, 3)))
    weights = model.evaluate(w_i, w_o) * np.maximum(w_i[:, 2:], 0.0) / model.pdf(w_i, w_o)[:, None]
    at, measure = directions(w_o[0])
    albedo = (np.maximum(at[:, 2], 0.0) * measure) @ model.evaluate(at, _view(degrees, len(at)))
    tolerance = 4 * weights.std(axis=0) / np.sqrt(count) + 2e-3 * albedo
    sampled = weights.mean(axis=0)
    assert np.all(np.abs(sampled - albedo) < tolerance), (
        f"{model.kind}: albedo {sampled} sampled, {albedo} integrated"
    )


def _assert_equal(one: Model, other: Model) -> None:
    """Two models are equal in values, density and samples, to the last bit."""
    w_i, w_o = random_directions(500, 1), random_directions(500, 2)
    u = np.random.default_rng(1).random((500, 3))
    assert type(one) is type(other)
    assert (one.floats, one.reciprocal) == (other.floats, other.reciprocal)
    np.testing.assert_array_equal(one.evaluate(w_i, w_o), other.evaluate(w_i, w_o))
    np.testing.assert_array_equal(one.sample(w_o, u), other.sample(w_o, u))
    np.testing.assert_array_equal(one.pdf(w_i, w_o), other.pdf(w_i, w_o))


def _view(degrees: float, count: int) -> Array:
    return np.tile(direction(np.radians(degrees), 0.3), (count, 1))


def _turned(w: Array) -> Array:
    """Directions (n, 3), each turned about the normal by an angle of its own."""
    angle = np.random.default_rng(4).uniform(0, 2 * np.pi, len(w))
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.stack([w[:, 0] * cosine - w[:, 1] * sine, w[:, 0] * sine + w[:, 1] * cosine, w[:, 2]], axis=-1)
