"""Which cells a scene asks for, counted one by one, and what a fit to only these costs elsewhere."""

import numpy as np
import pytest

from fitters.expressions import parse
from fitters.fitting import FitSettings, Problem, fit_cells
from fitters.fitting.polish import polish
from fitters.fitting.reduction import SHARES, carriers, prices, reduction
from fitters.grid import SHAPE, cell_index, half_diff
from fitters.materials.material import from_samples
from fitters.scenes import LightTable
from fitters.scenes.table import uniform_light
from tests.fitters.fitting.conftest import LIT, ggx


@pytest.fixture(scope="module")
def problem(light, shiny, make_material):
    one = ggx(p2=0.4)
    return Problem([shiny, make_material("other", one, one, 0.3)], light, metric="light", cells=500, seed=2)


def test_the_uniform_light_is_what_a_white_sphere_reflects():
    """Under radiance 1 a BRDF of 1 sr^-1 reflects the integral of cos(theta_i), pi, at every pixel."""
    light = uniform_light()
    np.testing.assert_allclose(light.table.sum(axis=(1, 2, 3), dtype=np.float64), np.pi, rtol=3e-4)


def test_the_uniform_light_agrees_with_directions_drawn_at_random():
    """w_i and w_o drawn by their cosines land in a cell in proportion to the light that it carries."""
    rng = np.random.default_rng(0)
    count = 400_000
    phi, radius = rng.uniform(0, 2 * np.pi, (2, count)), np.sqrt(rng.random((2, count)))
    w = np.stack([radius * np.cos(phi), radius * np.sin(phi), np.sqrt(1 - radius**2)], axis=-1)
    drawn = np.bincount(cell_index(*half_diff(w[0], w[1])), minlength=np.prod(SHAPE)).reshape(SHAPE)
    carried = uniform_light().table[0] / np.pi

    # Over slabs of ten by ten by twenty cells, whose counts are then large.
    def slabs(cells):
        return cells.reshape(9, 10, 9, 10, 9, 20).sum(axis=(1, 3, 5), dtype=np.float64).ravel()

    expected = count * slabs(carried)
    many = expected > 100
    # Cells across the horizon are counted by their centres: a little more than the noise of counting.
    deviation = (slabs(drawn) - expected)[many] / np.sqrt(expected[many])
    assert np.mean(np.abs(deviation) < 3) > 0.97
    assert many.sum() > 200


def test_cells_are_counted(problem, light):
    found = reduction(problem)
    assert found.grid == np.prod(SHAPE)
    assert found.lit == LIT == np.count_nonzero(light.lit)
    # What `from_samples` makes is valid wherever both directions are above the horizon.
    assert found.above == found.measured == np.count_nonzero(problem.materials[0].valid)
    assert found.sampled == len(problem.sample)


def test_carriers_are_the_fewest_with_the_share(problem):
    """Against shares added up cell by cell, the largest first."""
    squares = problem.full.targets.astype(np.float64) ** 2
    carried = (squares / squares.sum(axis=1, keepdims=True)).mean(axis=0)
    for share in SHARES:
        chosen = carriers(problem.full, share)
        assert carried[chosen].sum() >= share * (1 - 1e-12)
        assert np.sort(carried)[::-1][: len(chosen) - 1].sum() < share
        assert reduction(problem).carrying[share] == len(chosen)


def test_a_scene_that_sees_one_half_leaves_the_other_open():
    """Lit near the normal only, brighter where it is dark: a fit to the scene knows nothing of the rest."""
    material = _two_halves()
    table = uniform_light().table.copy()
    table[:, 42:] = 0.0
    light = LightTable(table, table[0] > 0, "half")
    problem = Problem([material], light, metric="light", cells=400, confirm_cells=2000, seed=1)
    expression, bounds = parse("p0"), {"p0": (1e-3, 1e3)}
    found = fit_cells(expression, problem.fine, problem.metric, bounds)
    found = polish(expression, problem.full, problem.metric, bounds, found)
    of = prices(expression, problem, bounds, found, FitSettings(), turned=uniform_light())
    assert of["lit"].scene == pytest.approx(0.0, abs=1e-6)
    # 0.1 for 0.4, relative.
    assert of["lit"].beyond == pytest.approx(0.75, rel=1e-5)
    assert of["measured"].scene > of["lit"].scene
    assert of["measured"].beyond < of["lit"].beyond
    assert of["measured"].turned < of["lit"].turned
    assert of["99 %"].cells < of["lit"].cells < of["measured"].cells


def _two_halves():
    """0.1 where theta_half is small, 0.4 elsewhere."""
    samples = np.full((3, *SHAPE), 0.4)
    samples[:, :42] = 0.1
    # Few azimuths: enough of a difference, and a tenth of the cells.
    samples[..., np.arange(SHAPE[2]) % 15 != 0] = np.nan
    return from_samples("halves", samples, source="test", sha256="halves")


def test_a_material_alone_has_its_own_targets_on_the_same_cells(problem):
    alone = problem.of_material(1)
    assert alone.names == ("other",)
    for whole, part in zip(
        (problem.full, problem.fine, problem.sample), (alone.full, alone.fine, alone.sample), strict=True
    ):
        np.testing.assert_array_equal(part.targets, whole.targets[3:])
        np.testing.assert_array_equal(part.index, whole.index)
    bounds = {"p0": (1e-6, 1e3), "p1": (1e-6, 1e3)}
    expression = parse("p0 + p1 * wh.z")
    together = fit_cells(expression, problem.sample, problem.metric, bounds)
    np.testing.assert_allclose(
        fit_cells(expression, alone.sample, alone.metric, bounds).errors, together.errors[3:], rtol=1e-5
    )
