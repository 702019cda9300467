"""Hazards do what they say: to the samples they name, by the amount they name, and to nothing else."""

import numpy as np
import pytest

from fitters.grid import SHAPE, cell_directions
from fitters.scenes.lights import load_light
from fitters.stability.case import metal, studio
from fitters.stability.hazards import HAZARDS
from fitters.stability.hazards.hard_cases import SCALES
from fitters.stability.hazards.measurement import NOISE, SPIKES


@pytest.fixture(scope="module")
def base():
    return metal()


def made(base, name, level=0, seed=0):
    return HAZARDS[name].make(base, level, seed)


def steepest():
    """The larger of the two polar angles (90, 90, 180) of each cell, degrees."""
    return np.degrees(np.arccos(np.minimum(*(w[:, 2] for w in cell_directions())))).reshape(SHAPE)


@pytest.mark.parametrize("level", range(len(NOISE)))
def test_noise_is_as_strong_as_it_says(base, level):
    case = made(base, "noise", level)
    bright = base.material.valid & (base.material.table.min(axis=0) > 1e-3)
    ratio = case.measured.table[:, bright] / base.material.table[:, bright].astype(np.float64)
    assert np.std(ratio) == pytest.approx(NOISE[level], rel=0.02)
    assert np.mean(ratio) == pytest.approx(1, abs=0.002)
    assert abs(np.corrcoef(ratio)[0, 1]) < 0.02
    assert case.truth is base.material


def test_seeds_alone_decide(base):
    first, again, other = (made(base, "noise", 2, seed).measured for seed in (1, 1, 2))
    assert first.sha256 == again.sha256 != other.sha256
    np.testing.assert_array_equal(first.table, again.table)


def test_missing_directions_are_missing_and_others_as_they_were(base):
    back = made(base, "backscattering", 1).measured
    assert not back.valid[:, :5].any()
    np.testing.assert_array_equal(back.table[:, :, 5:], base.material.table[:, :, 5:])
    grazing = made(base, "grazing", 0).measured
    np.testing.assert_array_equal(grazing.valid, base.material.valid & (steepest() <= 60))


def test_a_shadow_over_backscattering_only_darkens_there(base):
    case = made(base, "backscattering", 0)
    ratio = case.measured.table[1] / np.where(base.material.valid, base.material.table[1], 1)
    assert 0.1 < ratio[:, 0][base.material.valid[:, 0]].min() < 0.3
    assert ratio[:, :5].max() <= 1 + 1e-6
    np.testing.assert_array_equal(case.measured.table[:, :, 5:], base.material.table[:, :, 5:])


def test_extrapolated_rows_hold_their_last_value(base):
    found = made(base, "grazing", 1).measured
    row, azimuth = 20, 90
    inside = np.flatnonzero(steepest()[row, :, azimuth] <= 60)[-1]
    beyond = np.flatnonzero(base.material.valid[row, :, azimuth])
    held = found.table[:, row, beyond[beyond > inside], azimuth]
    np.testing.assert_array_equal(held, np.broadcast_to(found.table[:, row, [inside], azimuth], held.shape))
    assert any("filled in" in doubt for doubt in found.doubts)


@pytest.mark.parametrize("level", range(len(SPIKES)))
def test_what_is_left_of_fireflies_that_were_found_is_the_truth(base, level):
    """All but a few at the horizon, where neighbours are too few to judge by; no good cell is lost."""
    measured = made(base, "fireflies", level).measured
    count = np.count_nonzero(base.material.valid)
    changed = measured.valid & (measured.table[1] != base.material.table[1])
    bright = changed & (measured.table[1] > 10 * np.median(base.material.table[1][base.material.valid]))
    assert np.count_nonzero(bright & (steepest() < 85)) <= 0.02 * SPIKES[level] * count
    assert measured.spikes == np.count_nonzero(base.material.valid & ~measured.valid)
    assert 0.5 * SPIKES[level] * count < measured.spikes < 1.1 * SPIKES[level] * count


def test_samples_below_zero_are_counted_and_zeros_are_not_measured(base):
    negative = made(base, "zeros", 0).measured
    assert min(negative.negative) > 0.1
    assert negative.dropouts == 0
    zero = made(base, "zeros", 1).measured
    assert zero.dropouts == pytest.approx(0.2 * np.count_nonzero(base.material.valid), rel=0.02)
    np.testing.assert_array_equal(zero.table[:, zero.valid], base.material.table[:, zero.valid])


@pytest.mark.parametrize("level", range(len(SCALES)))
def test_a_scale_is_a_factor(base, level):
    np.testing.assert_allclose(
        made(base, "scale", level).truth.table, base.material.table * SCALES[level], rtol=1e-6
    )


def test_scenes_of_one_texel(base):
    mirror, dark = made(base, "mirror"), made(base, "dark-scene")
    # A texel of 11 degrees is a ring of half as much, that behind the sphere the last one.
    rings = [np.unique(np.nonzero(case.light.lit)[1]) for case in (mirror, dark)]
    assert len(rings[0]) < 8
    assert rings[1].min() > 80
    assert dark.light.table.sum() < 2e-3 * mirror.light.table.sum()
    # As much light arrives as the studio sends to a plane that faces the texel: at most its whole power.
    power = load_light("studio").power()
    totals = mirror.light.table.sum(axis=(1, 2, 3), dtype=np.float64)
    assert np.all(totals < power)
    np.testing.assert_allclose(totals / totals[0], power / power[0], rtol=1e-4)
    assert studio().lit.sum() > 10 * np.count_nonzero(mirror.light.lit)


def test_an_empty_channel_and_a_turning_colour(base):
    assert not made(base, "empty-channel").truth.table[2].any()
    turned = made(base, "colour-changing").truth.table
    ratio = turned[:, 10, :60, 90] / base.material.table[:, 10, :60, 90]
    # Three thirds of a period apart, the factors add up to 3 everywhere.
    np.testing.assert_allclose(ratio.sum(axis=0), 3, rtol=1e-5)
    assert np.ptp(ratio[0]) > 1
