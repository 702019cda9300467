"""Verdicts tell a sound fitter from one that is broken, and one that says so from one that does not."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fitters.errors import FittersError
from fitters.expressions.catalogue import formula
from fitters.models import FormulaModel
from fitters.stability import HAZARDS, METHODS, Trial, cells_of, failed, level_names, run_trial, trials_of
from fitters.stability.case import ALPHA, R0, metal, undisturbed
from fitters.stability.methods import Found
from fitters.stability.trial import UNDISTURBED, outcome_of, same_warning, spread
from fitters.stability.verdict import judged

HEALTHY, DISTURBED = Trial("fake", UNDISTURBED, 0, 0), Trial("fake", "noise", 2, 0)


@pytest.fixture(scope="module")
def case():
    return undisturbed(metal())


def ggx(alpha=ALPHA, scale=1.0, said=(), ends=None):
    """A method that always finds the same GGX."""
    model = FormulaModel(formula("ggx").expression, np.array([[0.0, scale, alpha, r0] for r0 in R0]))
    return lambda case, seed: Found(model, said, ends, {"ggx": {"p2": (alpha,) * 3}})


def raising(error):
    def run(case, seed):
        raise error

    return run


def verdict(case, run):
    return judged(outcome_of(DISTURBED, case, run), outcome_of(HEALTHY, case, ggx()))


def test_the_truth_stands(case):
    found = verdict(case, ggx())
    assert (found.how, found.noticed) == ((), ())
    assert found.outcome.errors["light"] < 1e-6


def test_errors_are_relative_to_the_truth(case):
    """A fit that is 10 % too bright everywhere is 10 % off, by any metric."""
    found = outcome_of(DISTURBED, case, ggx(scale=1.1))
    for name in ("light", "compressive"):
        assert found.errors[name] == pytest.approx(0.1, rel=1e-4)


@pytest.mark.parametrize(
    ("run", "how", "noticed"),
    [
        (ggx(scale=2.0), ("error",), True),
        (ggx(alpha=2 * ALPHA), ("error", "parameter"), True),
        (ggx(scale=math.nan), ("error",), True),
        (ggx(ends=np.array([[0.1] * 3, [0.1, 0.1, 0.3]])), ("spread",), False),
        (ggx(ends=np.array([[0.1] * 3, [0.3] * 3]), said=("starts disagree",)), ("spread",), True),
        (raising(FittersError("no backscattering")), ("raised",), True),
        (raising(IndexError("of bounds")), ("crashed",), True),
    ],
)
def test_what_is_broken_fails_by_its_criterion(case, run, how, noticed):
    found = verdict(case, run)
    assert found.how == how
    assert bool(found.noticed) == noticed


def test_a_fit_that_is_wrong_where_nothing_was_measured_is_silent(case):
    """Against the measurement its error is small, so that nothing but the truth tells."""
    measured = replace(case.measured, table=(2 * case.measured.table).astype(np.float32))
    found = judged(
        outcome_of(DISTURBED, replace(case, measured=measured), ggx(scale=2.0)), outcome_of(HEALTHY, case, ggx())
    )
    assert (found.how, found.noticed) == (("error",), ())


def test_cells_sum_up_seeds(case):
    healthy = outcome_of(HEALTHY, case, ggx())
    good = outcome_of(DISTURBED, case, ggx())
    bad = outcome_of(replace(DISTURBED, seed=1), case, ggx(scale=1.5))
    lost = failed(replace(DISTURBED, seed=2), "crashed its process 5 times")
    cells = cells_of([healthy, good, bad, lost], level_names())
    assert [cell.rate for cell in cells] == [0, 2 / 3]
    assert (cells[0].line, cells[1].level) == ("", "10%")
    assert cells[1].how == ("crashed", "error")
    assert "fake, noise (10%)" in cells[1].line
    assert "67% of 3 trials" in cells[1].line


def test_warnings_are_the_same_kind_whatever_their_numbers():
    assert same_warning("red: starts end up to 39.4 % apart") == same_warning("blue: starts end up to 2 % apart")
    assert same_warning("metal: p0 stands at its bound 1e-06") != same_warning("metal: p0 and p1 trade off")


def test_the_spread_of_exact_fits_is_none():
    assert spread(np.array([[1e-9, 1e-12], [1e-7, 1e-4]])) == pytest.approx(0.01, abs=1e-3)
    assert spread(np.array([[0.1], [0.15]])) == pytest.approx(0.5)
    assert spread(np.array([[0.1]])) is None


def test_seeds_that_change_nothing_are_left_out():
    trials = trials_of(["ggx", "bivariate"], ["noise", "scale"], 3, any_material=False)
    assert len(set(trials)) == len(trials)
    counts = {
        (method, hazard): sum(t.method == method and t.hazard == hazard for t in trials)
        for method in ("ggx", "bivariate")
        for hazard in ("noise", "scale")
    }
    levels = {name: len(HAZARDS[name].levels) for name in ("noise", "scale")}
    assert counts["bivariate", "noise"] == counts["ggx", "noise"] == 3 * levels["noise"]
    assert (counts["bivariate", "scale"], counts["ggx", "scale"]) == (levels["scale"], 3 * levels["scale"])
    assert not any(t.hazard == "mirror" for t in trials_of(list(METHODS), list(HAZARDS), 1, any_material=True))


@pytest.mark.parametrize("level", [0, 1])
def test_the_engine_finds_a_scaled_material_as_it_finds_the_material(level):
    """GGX explains the material exactly, so that any unit must leave nothing, and alpha where it was."""
    found = run_trial(None, Trial("ggx", "scale", level, 0))
    assert found.errors["light"] < 1e-3
    assert found.parameters < 1e-3
    assert any("no reflectance in sr^-1" in said for said in found.warnings)


def test_poor_backscattering_is_said_by_power_iterations():
    found, healthy = (
        run_trial(None, Trial("power-iterations", name, 0, 0)) for name in ("backscattering", UNDISTURBED)
    )
    assert "error" in judged(found, healthy).how
    assert any("unexplained" in said for said in found.warnings)
    assert not any("unexplained" in said for said in healthy.warnings)


def test_fits_survive_fireflies_and_zeros():
    for hazard, level in (("fireflies", 1), ("zeros", 1)):
        assert run_trial(None, Trial("npf-naive", hazard, level, 0)).errors["light"] < 0.05
