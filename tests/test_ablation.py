"""What the ablation switches off is off, and changes nothing else."""

import math
import os
import time
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest

from fitters.backends.program import lower
from fitters.engine import prepared
from fitters.expressions import parse
from fitters.expressions.catalogue import CATALOGUE
from fitters.fitting import fit_cells
from fitters.judging.metrics import RESIDUALS
from gpsearch.run import Store
from gpsearch.search.plan import problem_recipe
from tests.benchmarks import ablation_fits
from tests.benchmarks.ablation import (
    Extent,
    configured,
    in_turns,
    judged,
    run_arm,
    table,
)
from tests.benchmarks.ablation_fits import SAME_FITS
from tests.benchmarks.arms import ARMS, WITHOUT_MEMORY, WITHOUT_PROJECTION, Arm, fit_as_the_paper, substituted

pytestmark = pytest.mark.long

SMALL = Extent(
    islands=2, size=4, scene={"resolution": 8, "light_rows": 6}, budget={"generations": 2, "minutes": None}
)
WIDE = {f"p{i}": (1e-6, 1e5) for i in range(4)}
SETTINGS = {"cells": 256, "confirm_cells": 512, "starts": 32}


@pytest.fixture(scope="module")
def problem():
    return problem_recipe(configured(Arm("x", SETTINGS), 1, None, SMALL)).build()


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A small run of every arm."""
    place = tmp_path_factory.mktemp("arms")
    for name, arm in ARMS.items():
        run_arm(arm, configured(arm, 1, None, SMALL), place / name)
    return {name: [place / name] for name in ARMS}


def test_every_arm_has_a_row_of_finite_numbers(folders):
    rows = {row[0]: row for row in table(folders).rows}
    assert list(rows) == list(ARMS)
    for name, row in rows.items():
        numbers = [cell for cell in row[1:] if cell is not None]
        assert all(math.isfinite(number) and number >= 0 for number in numbers), row
        assert judged(folders[name][0])[0] == row[2] == 16
        # What it reaches at its end is there whatever the arm.
        assert row[6] > 0


def test_a_run_goes_on_with_a_larger_budget(folders):
    """All that is substituted is back in its place then, too: nothing else may have changed."""
    longer = Extent(2, 4, SMALL.scene, {"generations": 3, "minutes": None})
    (run,) = folders["no-warm-starts"]
    run_arm(ARMS["no-warm-starts"], configured(ARMS["no-warm-starts"], 1, None, longer), run)
    assert judged(run)[0] == 24


@pytest.mark.parametrize("name", [name for name, arm in ARMS.items() if arm.substitutes])
def test_what_is_substituted_is_put_back(name):
    before = [getattr(place, attribute) for place, attribute, _ in ARMS[name].substitutes]
    with substituted(ARMS[name]):
        for place, attribute, value in ARMS[name].substitutes:
            assert getattr(place, attribute) is value
    assert before == [getattr(place, attribute) for place, attribute, _ in ARMS[name].substitutes]


def test_without_projection_every_parameter_is_searched():
    with substituted(Arm("x", {}, (WITHOUT_PROJECTION,))):
        program = prepared.lower(CATALOGUE["ggx"].expression)
    assert (program.searched, program.linear) == (CATALOGUE["ggx"].expression.parameters, ())
    assert lower(CATALOGUE["ggx"].expression).linear == ("p0", "p1")


@pytest.mark.parametrize(("name", "factor"), [("lambert", 1.001), ("phong", 1.02), ("ggx", 1.5)])
def test_without_projection_a_fit_is_never_better_and_on_an_easy_formula_as_good(problem, name, factor):
    """The closed form is the least squares optimum within the box: a simplex over the same box cannot beat it."""
    expression = CATALOGUE[name].expression
    solved = fit_cells(expression, problem.sample, problem.metric, WIDE)
    with substituted(Arm("x", {}, (WITHOUT_PROJECTION,))):
        searched = fit_cells(expression, problem.sample, problem.metric, WIDE)
    assert 0.999 * solved.error <= searched.error <= factor * solved.error


def test_the_paper_s_fit_of_a_constant_is_the_least_squares_one(problem):
    """Of || w (p - m) || / s, over p: the error is the part of w m that w does not explain."""
    cells = problem.full
    with substituted(ARMS["paper"]):
        found = fit_as_the_paper(parse("p0"), cells, RESIDUALS["light"], WIDE)
    assert found.evaluations > 3 * len(cells.targets)
    for target, (w, wy) in enumerate(zip(cells.weights.astype(float), cells.targets.astype(float), strict=True)):
        least = w @ wy / (w @ w)
        assert found.values[target, 0] == pytest.approx(least, rel=5e-3)
        assert found.errors[target] == pytest.approx(np.linalg.norm(w * least - wy), rel=1e-4)


def test_without_memory_the_front_is_the_same(tmp_path):
    """To the last bit, where fits are neither given up nor inherited: what is fitted again gets the same fit."""
    plain = {**SETTINGS, "early_stopping": False, "warm_starts": False}
    extent = Extent(2, 8, SMALL.scene, {"generations": 6, "minutes": None})
    fronts, fitted = [], []
    for substitutes in ((), (WITHOUT_MEMORY,)):
        arm, run = Arm("memory", plain, substitutes), tmp_path / str(len(substitutes))
        run_arm(arm, configured(arm, 1, None, extent), run)
        store = Store.open(run)
        fronts.append([(m.expression, m.error, m.screened) for m in store.front().members])
        fitted.append(sum(1 for _ in store.fits()))
        store.close()
    assert fronts[0] == fronts[1]
    assert fitted[0] < fitted[1]


def test_turns_are_taken_one_at_a_time_and_to_the_end(tmp_path):
    """Processor time is what counts: a work that waits for its turn uses none."""
    log = tmp_path / "log"

    def work(name):
        began = time.process_time()
        while time.process_time() - began < 0.15:
            with log.open("a") as file:
                file.write(name)

    in_turns({name: partial(work, name) for name in "ab"}, slice_seconds=0.05)
    text = log.read_text()
    assert set(text) == {"a", "b"}
    changes = sum(one != other for one, other in pairwise(text))
    assert changes >= 2


def test_a_work_that_fails_is_named(tmp_path):
    with pytest.raises(RuntimeError, match="for the reasons above: bad"):
        in_turns({"good": lambda: None, "bad": partial(os._exit, 3)}, slice_seconds=0.05)


def test_the_same_candidates_are_fitted_in_every_way():
    small_fits = {name: replace(arm, fit={**SETTINGS, **arm.fit}) for name, arm in ARMS.items()}
    extent = Extent(1, 8, SMALL.scene, {"generations": 2, "minutes": None})
    configurations = {name: configured(arm, 1, None, extent) for name, arm in small_fits.items()}
    rows = ablation_fits.table(configurations, ablation_fits.Extent(sampled=6, all_cells=2)).rows
    counts = {row[0]: row[1] for row in rows}
    assert counts == {name: 2 if "cells" in ARMS[name].fit else 6 for name in ARMS if name not in SAME_FITS}
    assert rows[0][0] == "full"
    assert (rows[0][3], rows[0][5], rows[0][6]) == (1.0, "0 %", "0 %")
    assert all(row[2] > 0 for row in rows)
