import numpy as np
import pytest

from fitters import grid
from fitters.materials import builtin_names, load_material, summarise, synthetic


@pytest.mark.parametrize("name", builtin_names())
def test_every_builtin_is_a_plausible_measurement(name):
    material = load_material(f"builtin:{name}")
    summary = summarise(material)
    assert (material.name, material.source, material.negative) == (name, "built-in", (0, 0, 0))
    assert summary.invalid_share == 0
    assert not summary.gains_energy
    assert min(summary.hemispherical_albedo) > 0.05
    assert len(set(summary.hemispherical_albedo)) == 3


def test_a_builtin_is_the_same_every_time_and_the_noise_differs_between_them():
    first = load_material("builtin:metal")
    synthetic._make.cache_clear()
    assert np.array_equal(first.table, load_material("builtin:metal").table)
    assert len({load_material(f"builtin:{name}").sha256 for name in builtin_names()}) == len(builtin_names())


@pytest.mark.parametrize("name", builtin_names())
def test_the_noise_has_no_bias_and_grows_towards_grazing(name):
    above = grid.above_horizon()
    w_i, w_o = (w[above.ravel()] for w in grid.cell_directions())
    clean = synthetic.brdf(synthetic.BUILT_IN[name], w_i, w_o)
    noise = np.log(load_material(f"builtin:{name}").table[:, above].T / clean)
    lowest = np.minimum(w_i[:, 2], w_o[:, 2])
    assert abs(noise.mean()) < 1e-3
    assert 0.015 < noise[lowest > 0.9].std() < 0.025
    assert 0.08 < noise[lowest < 0.05].std() < 0.13


@pytest.mark.parametrize("name", builtin_names())
def test_the_formulas_are_reciprocal(name, random_pairs):
    w_i, w_o = random_pairs
    recipe = synthetic.BUILT_IN[name]
    np.testing.assert_allclose(synthetic.brdf(recipe, w_i, w_o), synthetic.brdf(recipe, w_o, w_i), rtol=1e-10)


@pytest.mark.parametrize("lobe", [lobe for recipe in synthetic.BUILT_IN.values() for lobe in recipe.lobes])
def test_the_projected_area_of_the_microfacets_is_one(lobe):
    edges = np.linspace(0, 1, 20_001) ** 2
    cos = 1 - 0.5 * (edges[1:] + edges[:-1])
    assert np.sum(2 * np.pi * synthetic._ndf(lobe, cos) * cos * np.diff(edges)) == pytest.approx(1, abs=1e-3)


def test_the_fabric_reflects_towards_the_light():
    material = load_material("builtin:fabric").table
    towards, aside = material[:, 40:50, 0], material[:, 40:50, 35:40, 80:100]
    assert np.all(towards.mean(axis=(1, 2)) > 1.5 * aside.mean(axis=(1, 2, 3)))
