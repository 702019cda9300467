"""The contract of metrics: `check_metric(metric)` asserts what every entry of `METRICS` must do.

    from fitters.testing.metrics import check_metric
    check_metric(METRICS["light"])

A metric is asked about a small material, a light and pictures that are made here, beside models that are worse and
worse. The checks take well under a second for a metric on tables, and a few for one on images.
"""

import functools
import itertools
import math
import re

import numpy as np

from fitters.errors import FittersError
from fitters.grid import CELLS, SHAPE, Array, above_horizon
from fitters.judging.metrics import Compared, Metric, Residual
from fitters.materials import Material
from fitters.materials.material import from_samples
from fitters.rendering import Picture
from fitters.scenes import LightTable

NOISE = (0.01, 0.05, 0.2, 0.8)
"""Standard deviations, relative to the truth, of models that are worse and worse."""
SIZE = 48
"""Pixels across the pictures."""
EQUAL = 1e-6
"""Up to this value a metric may have rounding errors where model and measurement are equal."""
COLUMN = 9
"""Characters that fit above a column of ten."""


def check_metric(metric: Metric) -> None:
    """All checks; raises `AssertionError` that names the metric and what it does wrong."""
    check_description(metric)
    check_equal_inputs(metric)
    check_growing_noise(metric)
    check_exchange(metric)
    check_black(metric)
    check_slack(metric)
    if isinstance(metric, Residual):
        check_weights(metric)


def check_description(metric: Metric) -> None:
    """Its name can be typed in a tolerance, fits above a column, and the protocol says how it is computed."""
    assert re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", metric.name), f"{metric.name!r}: a name is like delta-e-2000"
    assert len(metric.short) <= COLUMN, f"{metric.name}: short is longer than {COLUMN} characters: {metric.short}"
    assert len(metric.protocol) >= 20, f"{metric.name}: the protocol does not say how the value is computed"
    assert metric.better in ("lower", "higher"), f"{metric.name}: better is lower or higher"


def check_equal_inputs(metric: Metric) -> None:
    """A model that equals the measurement has the best value."""
    value = value_of(metric, 1.0)
    equal = value == metric.best or abs(value - metric.best) < EQUAL
    assert equal, f"{metric.name}: equal inputs have {value}, not {metric.best}"


def check_growing_noise(metric: Metric) -> None:
    """More noise is worse, and every value is finite."""
    values = [value_of(metric, _noise(amount)) for amount in NOISE]
    assert all(map(math.isfinite, values)), f"{metric.name}: not finite for noise {NOISE}: {values}"
    worse = all(metric.margin(first, second) < 0 for first, second in itertools.pairwise(values))
    assert worse, f"{metric.name}: noise {NOISE} is not worse and worse: {values}"


def check_exchange(metric: Metric) -> None:
    """Measurement and model may change places where the metric says so; where not, the values are finite, too."""
    forth, back = value_of(metric, _noise(0.2)), value_of(metric, _noise(0.2), exchanged=True)
    assert math.isfinite(back), f"{metric.name}: not finite where measurement and model change places: {back}"
    if metric.symmetric:
        assert math.isclose(forth, back, rel_tol=1e-5), f"{metric.name}: not symmetric: {forth} and {back}"


def check_black(metric: Metric) -> None:
    """A black model is finite and not the best; of a black measurement it says so, or a value that is a number."""
    value = value_of(metric, 0.0)
    assert math.isfinite(value), f"{metric.name}: a black model has {value}"
    assert metric.margin(metric.best, value) < 0, f"{metric.name}: a black model has the best value, {value}"
    for factor in (0.0, 1.0):
        said, value = "", 0.0
        try:
            value = value_of(metric, factor, black=True)
        except FittersError as error:
            said = str(error)
        assert not math.isnan(value), f"{metric.name}: a black measurement gives NaN"
        assert not said or "black" in said, f"{metric.name}: does not say that the measurement is black: {said}"


def check_slack(metric: Metric) -> None:
    """Slack has the sign of the margin, so that a tolerance holds exactly where there is slack."""
    low, high = value_of(metric, _noise(NOISE[0])), value_of(metric, _noise(NOISE[-1]))
    for bound, value in ((low, high), (high, low)):
        same = np.sign(metric.margin(bound, value)) == np.sign(metric.slack(bound, value))
        assert same, f"{metric.name}: margin and slack of {value} at a bound of {bound} have different signs"


def check_weights(residual: Residual) -> None:
    """Weights are finite, not negative and those of each cell; an error is || weights f - targets ||, from 0."""
    light, measured = np.geomspace(1e-4, 10, 400), np.geomspace(1e2, 1e-3, 400)
    for values in (measured, 0 * measured, np.where(np.arange(400) < 10, 0, measured)):
        weights, targets = residual.weighted(light, values)
        assert weights.shape == targets.shape == light.shape, f"{residual.name}: weights are not one per cell"
        assert np.isfinite(weights).all(), f"{residual.name}: a weight is not finite"
        assert (weights >= 0).all(), f"{residual.name}: a weight is negative"
        np.testing.assert_allclose(weights * values, targets, err_msg=residual.name)
    assert np.isfinite(residual.weighted(0 * light, measured)[0]).all(), f"{residual.name}: no light gives NaN"
    error = residual.combine(np.array([0.3, 0.3]))
    assert math.isclose(residual.squares(error, 2), 0.18), f"{residual.name}: squares does not undo combine"


def value_of(metric: Metric, factor: Array | float, *, exchanged: bool = False, black: bool = False) -> float:
    """The metric of a model that is the material's table and picture times a factor (`CELLS`,).

    `exchanged`: measurement and model change places. `black`: the measurement is black, the model is as before.
    """
    truth, light, image = _material(), _light(), _picture()
    of_cells = np.broadcast_to(np.asarray(factor, np.float64), (CELLS,))
    values = truth.table * of_cells.reshape(SHAPE)
    picture = Picture(image.pixels * of_cells[: SIZE * SIZE].reshape(SIZE, SIZE, 1), image.foreground)
    if black:
        truth, image = _black_material(), Picture(0 * image.pixels, image.foreground)
    elif exchanged:
        model = _made(np.where(truth.valid, values, np.nan))
        values, truth = truth.table.astype(np.float64), model
        picture, image = image, picture
    return metric.measure(Compared(truth, light, values, image, picture)).value


def _noise(amount: float) -> Array:
    """Positive factors (`CELLS`,) about 1."""
    return np.maximum(1 + amount * _deviates(), 0.05)


@functools.cache
def _deviates() -> Array:
    return np.random.default_rng(7).standard_normal(CELLS)


@functools.cache
def _black_material() -> Material:
    """The material with all measured values 0."""
    return _made(np.where(_material().valid, 0.0, np.full((3, *SHAPE), np.nan)))


def _made(table: Array) -> Material:
    return from_samples("contract", table, source="contract suite", sha256="0" * 32)


@functools.cache
def _material() -> Material:
    """Values of four decades, measured in one cell of fifty."""
    random = np.random.default_rng(1)
    samples = 10 ** random.uniform(-3, 1, (3, CELLS))
    samples[:, random.random(CELLS) > 0.02] = np.nan
    return _made(samples.reshape(3, *SHAPE))


@functools.cache
def _light() -> LightTable:
    """Light of three decades in every other cell above the horizon."""
    random = np.random.default_rng(2)
    table = 10 ** random.uniform(-3, 0, (3, CELLS))
    table[:, (random.random(CELLS) < 0.5) | ~above_horizon().ravel()] = 0.0
    shaped = table.astype(np.float32).reshape(3, *SHAPE)
    return LightTable(shaped, np.any(shaped > 0, axis=0), "0" * 32)


@functools.cache
def _picture() -> Picture:
    """A disc with a coloured gradient and a small, bright window."""
    x, y = np.meshgrid(np.linspace(-1, 1, SIZE), np.linspace(-1, 1, SIZE))
    pixels = np.stack([0.6 + 0.5 * x, 0.45 + 0.25 * y, 0.4 - 0.1 * x * y], axis=-1)
    pixels[10:14, 20:24] += [60.0, 50.0, 40.0]
    foreground = x**2 + y**2 < 0.99
    return Picture(np.where(foreground[..., None], pixels, 0.0), foreground)
