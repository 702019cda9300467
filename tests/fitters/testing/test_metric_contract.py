"""Every registered metric passes the contract suite, and the suite finds what it is there to find."""

from dataclasses import replace

import numpy as np
import pytest

from fitters.errors import FittersError
from fitters.judging.metrics import IMAGE_METRICS, METRICS, RESIDUALS, Comparison
from fitters.judging.metrics.contract import registered
from fitters.testing import metrics as suite


@pytest.mark.parametrize("name", METRICS)
def test_registered_metrics_pass(name):
    suite.check_metric(METRICS[name])


def compared_by(distance):
    return replace(IMAGE_METRICS["l2"], between=lambda truth, model: Comparison(distance(truth, model)))


BROKEN = {
    "a name": (replace(RESIDUALS["light"], name="Light error"), "a name is like"),
    "a header": (replace(RESIDUALS["light"], short="light error"), "short is longer"),
    "no protocol": (replace(RESIDUALS["light"], protocol=""), "protocol"),
    "equal inputs": (compared_by(lambda truth, model: 1.0), "equal inputs have 1.0, not 0.0"),
    "direction": (
        replace(compared_by(lambda truth, model: float(np.ptp(truth.pixels - model.pixels))), better="higher"),
        "equal inputs have 0.0, not inf",
    ),
    "blind": (compared_by(lambda truth, model: 0.0), "not worse and worse"),
    "NaN": (
        compared_by(lambda truth, model: 0.0 if np.array_equal(truth.pixels, model.pixels) else float("nan")),
        "not finite",
    ),
    "not symmetric": (replace(IMAGE_METRICS["l2"], symmetric=True), "not symmetric"),
    "weights": (
        replace(RESIDUALS["light"], weights=lambda light, measured: -light),
        "a weight is negative",
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_metric_is_found(case):
    metric, message = BROKEN[case]
    with pytest.raises(AssertionError, match=message):
        suite.check_metric(metric)


def test_two_metrics_of_one_name_are_refused():
    with pytest.raises(FittersError, match="two are called light"):
        registered([RESIDUALS["light"]], [RESIDUALS["light"], RESIDUALS["compressive"]])


def test_the_choices_of_a_fit_are_the_residuals_under_a_light():
    assert list(RESIDUALS)[:3] == ["light", "compressive", "light-sum"]
    assert all(metric.measured_on == "light table" for metric in RESIDUALS.values())
