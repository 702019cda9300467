"""The benchmarks still run. What they measure is theirs to say."""

import math
from dataclasses import replace

import pytest

from fitters.expressions.catalogue import CATALOGUE
from fitters.materials import load_material
from fitters.models.factors import solving
from fitters.rendering import image_map
from fitters.scenes import Scene, light_table, load_light
from tests.benchmarks import (
    baselines,
    evaluation,
    fitting,
    growth,
    light,
    light_search,
    quality,
    scaling,
    search,
    solvers,
    speed,
    stopping,
)
from tests.benchmarks.engine import SEARCHES, SECTIONS
from tests.benchmarks.point_sampled import point_sampled
from tests.benchmarks.problem import recipe

pytestmark = pytest.mark.long

SMALL = {
    "evaluation": evaluation.Extent(cells=(256,), rounds=1),
    "fitting": fitting.Extent(random=1, sample_targets=1, full=("lambert",)),
    "quality": quality.Extent(random=2, scipy=1),
    "growth": growth.Extent(cells=(256, 512), searched=(1, 2), targets=(3, 6), terms=(1, 2), rounds=1),
    "stopping": stopping.Extent(generations=3, islands=1, size=8),
    "search": search.Extent(generations=3, islands=2, size=8, processes=1),
}


SCALING = scaling.Extent(
    real=scaling.Size(2, 8, 2),
    real_workers=(1,),
    rounds=1,
    recorded=scaling.Size(1, 8, 2),
    simulated=((scaling.Size(2, 8, 3), (2, 4)),),
    bred=scaling.Size(1, 8, 3),
)


@pytest.fixture(scope="module")
def small_recipe():
    small = replace(recipe(None), scene=Scene(resolution=8, light_rows=8), cells=256, confirm_cells=512)
    return replace(small, materials=small.materials[:1])


@pytest.fixture(scope="module")
def problem(small_recipe):
    return small_recipe.build()


@pytest.mark.parametrize("section", SMALL)
def test_a_section_prints_tables_of_finite_positive_numbers(section, problem, small_recipe):
    if section in SECTIONS:
        tables = list(SECTIONS[section](problem, SMALL[section]))
    else:
        tables = list(SEARCHES[section](small_recipe, SMALL[section]))
    require_finite_positive_numbers(tables)


@pytest.mark.parametrize("section", scaling.SECTIONS)
def test_how_a_search_scales_is_measured(section, small_recipe):
    require_finite_positive_numbers(list(scaling.SECTIONS[section](small_recipe, SCALING)))


def require_finite_positive_numbers(tables):
    assert tables
    for table in tables:
        lines = table.text().splitlines()
        assert table.title == lines[0]
        assert table.rows
        for row in table.rows:
            assert len(row) == len(table.columns)
            numbers = [cell for cell in row if isinstance(cell, int | float)]
            assert numbers
            assert all(math.isfinite(number) and number >= 0 for number in numbers), row


def test_baselines_are_measured_and_summed_up(monkeypatch):
    rows = baselines.measured(load_material("builtin:metal"), ["bivariate", "power-iterations", "lambert"], None)
    assert [row.model for row in rows] == ["bivariate", "power-iterations", "lambert"]
    for row in rows:
        assert 0 < row.light < 2
        assert 10 < row.psnr < 100
        assert row.seconds > 0
    table = baselines.summary("built-in", rows)
    assert [line[:2] for line in table.rows] == [("bivariate", 24300), ("power-iterations", 540), ("lambert", 3)]
    assert "power-iterations" in baselines.failures("built-in", rows).text()


def test_solvers_are_compared(monkeypatch):
    monkeypatch.setattr(solvers, "FITS", {"npf-naive": solvers.FITS["npf-naive"]})
    monkeypatch.setattr(solving, "ROUNDS", 3)
    table = solvers.table([load_material("builtin:metal")], None)
    assert [row[1] for row in table.rows] == ["joint", "awls"]
    assert table.rows[1][3] >= table.rows[0][3] == 1


def test_evaluations_are_timed():
    models = {name: speed.formula(CATALOGUE[name].expression) for name in ("ggx", "lambert")}
    table = speed.table(models, count=500, rounds=2)
    assert [row[:2] for row in table.rows] == [("ggx", 12), ("lambert", 3), (speed.CALL, None)]
    assert all(row[2] > 0 and row[4] > 0 for row in table.rows)


def test_what_a_converged_light_changes_is_measured(tmp_path, monkeypatch):
    monkeypatch.setattr(light, "MODELS", ("lambert", "bivariate"))
    sky, material = load_light("studio"), load_material("builtin:metal")
    distances = light.convergence(sky, [(8, 6), (16, 12)])
    assert [row[1] for row in distances.rows][1:] == sorted((row[1] for row in distances.rows[1:]), reverse=True)
    require_finite_positive_numbers([distances, light.pictures(sky, [material], 12)])
    tables = {"point-sampled": point_sampled(sky, 8, 6), "converged": light_table(Scene())}
    seen, kept = image_map(Scene(resolution=16)), tmp_path / "rows"
    rows = list(light.kept(kept, light.rows_of([material], tables, seen, [])))
    assert len(rows) == 4
    assert list(light.rows_of([material], {}, seen, rows)) == []
    assert light._there(kept) == rows
    require_finite_positive_numbers([light.means(rows), light.per_material(rows)])
    assert light.ranks(rows).rows


def test_searches_on_two_light_tables_are_judged_by_the_same_pictures(small_recipe, monkeypatch):
    monkeypatch.setattr(light_search, "RESOLUTION", 16)
    monkeypatch.setattr(light_search, "SAMPLINGS", [(8, 6)])
    monkeypatch.setattr(light_search, "SIZES", (120,))
    table = light_search.compared(small_recipe, light_search.Extent(seeds=1, islands=1, size=4, generations=1))
    assert len(table.rows) == 2
    require_finite_positive_numbers([table])


def test_every_section_is_tested():
    assert {*SECTIONS, *SEARCHES} == set(SMALL)
