"""The fits of a model to test materials: what is missing or not finite is None, and never counted as good."""

import math

import numpy as np
import pytest

from fitters.fitting import RESIDUALS
from fitters.models import FitSummary
from gpsearch.run import Transfer
from gpsearch.run.loading import fit_on_tests

GOOD = Transfer((0.1, 0.2, 0.3), dict.fromkeys(RESIDUALS, 0.2), {"p0": (1.0, 2.0, 3.0)}, ("fabric: dark",))
BAD = Transfer((0.1, math.inf, 0.3), dict.fromkeys(RESIDUALS, math.inf), {"p0": (1.0, 1.0, 1.0)})


def test_without_test_materials_there_is_no_entry():
    assert fit_on_tests({}, "light", ("p0",)) is None


def test_a_formula_has_its_parameters_by_material():
    test = fit_on_tests({"fabric": GOOD, "metal": GOOD}, "light", ("p0",))
    assert test.errors == {"fabric": (0.1, 0.2, 0.3), "metal": (0.1, 0.2, 0.3)}
    assert test.parameters == {"p0": {"fabric": (1.0, 2.0, 3.0), "metal": (1.0, 2.0, 3.0)}}
    assert test.error == test.metrics["light"] == pytest.approx(0.2)
    assert test.warnings == ("fabric: dark",) * 2


@pytest.mark.parametrize("other", [BAD, None])
def test_where_a_fit_is_not_finite_or_not_there_the_error_of_all_is_null(other):
    test = fit_on_tests({"fabric": GOOD, "metal": other}, "light", ("p0",))
    assert test.error is None
    assert set(test.metrics.values()) == {None}
    assert test.errors["fabric"] == (0.1, 0.2, 0.3)
    assert None in test.errors["metal"]
    assert list(test.parameters["p0"]) == ["fabric"]


def test_a_table_has_no_parameters_and_says_why_it_is_not_there():
    infinite = dict.fromkeys(RESIDUALS, (math.inf,) * 3)
    judged = FitSummary(infinite, 0, 1.0, 0.0, ("metal: no cell with theta_diff below 1 degree is valid",))
    test = fit_on_tests({"metal": Transfer.of_table(judged, "light")}, "light", None)
    assert test.parameters is None
    assert test.errors == {"metal": (None,) * 3}
    assert test.warnings == judged.warnings


def test_a_tables_error_by_a_metric_is_that_of_its_channels():
    errors = dict.fromkeys(RESIDUALS, (0.1, 0.2, 0.4))
    transfer = Transfer.of_table(FitSummary(errors, 9, 1.0, 5.0, ()), "compressive")
    assert transfer.errors == (0.1, 0.2, 0.4)
    assert transfer.metrics["compressive"] == pytest.approx(np.sqrt((0.01 + 0.04 + 0.16) / 3))
    assert transfer.metrics["light-sum"] == pytest.approx(np.sqrt(0.01 + 0.04 + 0.16))
