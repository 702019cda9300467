"""What materials are made to share is found to be shared, and nothing else."""

import numpy as np
import pytest

from fitters.fitting.sharing import share, within
from tests.fitters.fitting.sharing.conftest import BOUNDS, LOBE

COLOURS = (((0.2, 0.5), (0.1, 0.4), (0.3, 0.8)), ((0.05, 1.5), (0.1, 1.0), (0.02, 0.7)))


def of_widths(*widths):
    """Two materials, every channel of its own colour, their six lobes of these widths."""
    return [
        tuple((*colour, width) for colour, width in zip(colours, widths[3 * i : 3 * i + 3], strict=True))
        for i, colours in enumerate(COLOURS)
    ]


def shared(made, tolerance=0.01):
    problem, free = made
    return share(LOBE, problem, BOUNDS, free, within(tolerance, problem.full))


@pytest.mark.parametrize(
    ("widths", "noise", "scope", "numbers", "floats"),
    [
        ((0.05,) * 6, 0.0, "set", 13, 7),
        ((0.05,) * 6, 0.02, "set", 13, 7),
        ((0.05,) * 3 + (0.02,) * 3, 0.02, "material", 14, 7),
        ((0.05, 0.03, 0.08, 0.02, 0.04, 0.06), 0.0, "channel", 18, 9),
    ],
)
def test_the_shape_is_shared_as_far_as_it_was_made_so(lobes, widths, noise, scope, numbers, floats):
    """Twelve colours are free, the width is one number, two or six."""
    found = shared(lobes(*of_widths(*widths), noise=noise))
    assert dict(zip(found.sharing.names, found.sharing.scopes, strict=True)) == {
        "p0": "channel",
        "p1": "channel",
        "p2": scope,
    }
    assert (found.sharing.numbers(2), found.sharing.floats) == (numbers, floats)
    assert found.fit.error <= 1.01 * found.free.error + 1e-6
    widths_found = found.fit.columns["p2"]
    np.testing.assert_allclose(widths_found, widths, rtol=0.05 if noise else 1e-3)
    assert len(np.unique(widths_found)) == {"set": 1, "material": 2, "channel": 6}[scope]


def test_a_grey_material_has_one_number_a_parameter(lobes):
    found = shared(lobes(((0.2, 0.5, 0.05),) * 3, noise=0.02))
    assert found.sharing.scopes == ("material",) * 3
    assert found.sharing.numbers(1) == found.sharing.floats == 3


def test_the_worst_material_decides(lobes):
    """The first material is noisy, so that what the second loses would not show in the error of both together."""
    widths = (0.05,) * 3 + (0.05, 0.05, 0.052)
    made = lobes(*of_widths(*widths))
    found = shared(made, tolerance=0.01)
    assert found.sharing.scopes[2] == "channel"


def test_no_material_grows_by_more_than_the_tolerance_and_more_tolerance_takes_no_more_numbers(lobes):
    tolerance = 0.1
    made = lobes(*of_widths(0.05, 0.055, 0.048, 0.02, 0.022, 0.021), noise=0.05)
    found, stricter = shared(made, tolerance), shared(made, tolerance / 10)
    for material in range(2):
        rows = slice(3 * material, 3 * material + 3)
        tied, free = (np.linalg.norm(fit.errors[rows]) for fit in (found.fit, found.free))
        assert free * (1 - 1e-7) <= tied <= (1 + tolerance) * free + 1e-5
    assert found.sharing.numbers(2) <= stricter.sharing.numbers(2)


@pytest.mark.parametrize("scale", [1e7, 1e-9])
def test_what_is_shared_does_not_depend_on_the_units(lobes, scale):
    """A measurement in other units, beyond the bounds of p0 and p1: the same scopes and errors, colours scaled."""

    def materials(unit):
        made = of_widths(0.05, 0.05, 0.05, 0.02, 0.02, 0.02)
        return [tuple((unit * p0, unit * p1, p2) for p0, p1, p2 in channels) for channels in made]

    ordinary, scaled = (shared(lobes(*materials(unit), noise=0.02)) for unit in (1.0, scale))
    assert scaled.sharing == ordinary.sharing
    np.testing.assert_allclose(scaled.fit.errors, ordinary.fit.errors, rtol=1e-4)
    np.testing.assert_allclose(scaled.fit.columns["p1"], scale * ordinary.fit.columns["p1"], rtol=1e-3)
