"""The levels of an environment map."""

import numpy as np
import pytest

from fitters.scenes import EnvironmentMap
from fitters.scenes.pyramid import pyramid


@pytest.mark.parametrize(
    ("rows", "levels"),
    [
        (1, [1]),
        (24, [12, 24]),
        (64, [8, 16, 32, 64]),
        (45, [45]),
        (90, [45, 90]),
        (67, [8, 16, 32, 64, 128]),
        (2048, [8, 16, 32, 64, 128, 256, 512, 1024]),
    ],
)
def test_levels_halve_the_map_and_keep_its_energy(rows, levels):
    light = EnvironmentMap(np.random.default_rng(0).exponential(size=(rows, 2 * rows, 3)))
    found = pyramid(light)
    assert found.rows.tolist() == levels
    for start, of in zip(found.starts, levels, strict=True):
        level = EnvironmentMap(found.texels[start : start + 2 * of**2].reshape(of, 2 * of, 3))
        np.testing.assert_allclose(level.power(), light.power(), rtol=1e-9)
    if rows == levels[-1]:
        np.testing.assert_array_equal(
            found.texels[found.starts[-1] :].reshape(light.radiance.shape), light.radiance
        )
