"""Spikes and dropouts are found, and nothing else is."""

import numpy as np
import pytest

from fitters.grid import SHAPE
from fitters.materials import load_material
from fitters.materials.material import from_samples
from fitters.materials.outliers import dropouts, spikes, without_outliers


def material(samples):
    return from_samples("made", np.broadcast_to(samples, (3, *SHAPE)), source="test", sha256="0")


@pytest.fixture(scope="module")
def lobe():
    """A highlight that falls by four orders of magnitude within six bins."""
    return np.broadcast_to(0.01 + 1e4 * np.exp(-1.5 * np.arange(90)[:, None, None]), SHAPE).copy()


def test_a_sharp_highlight_is_no_spike(lobe):
    assert not spikes(material(lobe)).any()


@pytest.mark.parametrize("name", ["metal", "glossy-plastic", "rough-plastic", "fabric"])
def test_noisy_materials_stay_as_they_are(name):
    found = load_material(f"builtin:{name}")
    assert without_outliers(found) is found


def test_spikes_are_found_alone_and_in_pairs(lobe):
    lobe = lobe.copy()
    places = [(30, 20, 50), (30, 20, 51), (0, 10, 0), (60, 5, 179)]
    for place in places:
        lobe[place] *= 1000
    found = without_outliers(material(lobe))
    assert sorted(map(tuple, np.argwhere(spikes(material(lobe))))) == sorted(places)
    assert found.spikes == 4
    assert not any(found.valid[place] for place in places)
    assert any("4 isolated spikes" in doubt for doubt in found.doubts)


def test_zeros_between_bright_cells_are_dropouts_and_a_black_region_is_not(lobe):
    lost = np.random.default_rng(0).random(SHAPE) < 0.05
    found = without_outliers(material(np.where(lost, 0, lobe)))
    assert found.dropouts == np.count_nonzero(lost & material(lobe).valid)
    black = lobe.copy()
    black[60:] = 0
    assert not dropouts(material(black)).any()


def test_zeros_that_noise_left_are_measurements():
    noisy = 0.1 * np.random.default_rng(0).standard_normal((3, *SHAPE)) + 0.1
    found = from_samples("noise", noisy, source="test", sha256="0")
    assert without_outliers(found) is found
    assert any("16% of its samples were below zero" in doubt for doubt in found.doubts)
