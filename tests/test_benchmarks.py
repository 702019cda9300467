"""The benchmarks still run. What they measure is theirs to say."""

import math
from dataclasses import replace

import pytest

from fitters.fits import build_problem
from fitters.scenes import Scene
from tests.benchmarks import evaluation, fitting, growth, quality, search, stopping
from tests.benchmarks.engine import SEARCHES, SECTIONS
from tests.benchmarks.problem import recipe

SMALL = {
    "evaluation": evaluation.Extent(cells=(256,), rounds=1),
    "fitting": fitting.Extent(random=1, sample_targets=1, full=("lambert",)),
    "quality": quality.Extent(random=2, scipy=1),
    "growth": growth.Extent(cells=(256, 512), searched=(1, 2), targets=(3, 6), terms=(1, 2), rounds=1),
    "stopping": stopping.Extent(generations=3, islands=1, size=8),
    "search": search.Extent(generations=3, islands=2, size=8, processes=1),
}


@pytest.fixture(scope="module")
def small_recipe():
    small = replace(recipe(None), scene=Scene(resolution=8, light_rows=8), sample_cells=256, fine_cells=512)
    return replace(small, materials=small.materials[:1])


@pytest.fixture(scope="module")
def problem(small_recipe):
    return build_problem(small_recipe)


@pytest.mark.parametrize("section", SMALL)
def test_a_section_prints_tables_of_finite_positive_numbers(section, problem, small_recipe):
    if section in SECTIONS:
        tables = list(SECTIONS[section](problem, SMALL[section]))
    else:
        tables = list(SEARCHES[section](small_recipe, SMALL[section]))
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


def test_every_section_is_tested():
    assert {*SECTIONS, *SEARCHES} == set(SMALL)
