import numpy as np
import pytest

from fitters.errors import FittersError
from fitters.materials import utia
from fitters.materials.material_file import read_file


def write(path, samples):
    path.write_bytes(np.ascontiguousarray(samples, "<f8").tobytes())
    return path


@pytest.fixture
def path(tmp_path):
    return tmp_path / "fabric.bin"


def direction(theta, phi):
    theta, phi = np.broadcast_arrays(np.radians(theta), np.radians(phi))
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def numbered():
    """Samples by the published layout: plane, light row, view column."""
    rows, columns = np.meshgrid(np.arange(288), np.arange(288), indexing="ij")
    return np.stack([1000.0 * rows + columns + plane * 1e-3 for plane in range(3)])


def test_rows_are_light_and_columns_are_view(path):
    material = utia.load(read_file(write(path, numbered())))
    light, view = (3, 7), (2, 40)
    value = material.evaluate(
        direction([15 * light[0]], [7.5 * light[1]]), direction([15 * view[0]], [7.5 * view[1]])
    )
    row, column = 48 * light[0] + light[1], 48 * view[0] + view[1]
    np.testing.assert_allclose(value[0], 1000 * row + column + np.array([0, 1e-3, 2e-3]), rtol=1e-6)
    assert material.name == "fabric"
    assert material.source == "UTIA format"
    assert path.stat().st_size == 1_990_656


def test_is_linear_in_the_four_angles_and_periodic_in_azimuth(path):
    theta, phi = np.arange(6) * 15.0, np.arange(48) * 7.5
    ramp = np.abs(phi - 180)
    samples = theta[:, None, None, None] + ramp[:, None, None] + 2 * theta[:, None] + 3 * ramp
    material = utia.load(read_file(write(path, np.stack([samples, 2 * samples, 3 * samples]))))
    random = np.random.default_rng(1)
    theta_i, theta_o = random.uniform(0.1, 75, (2, 200))
    phi_i, phi_o = random.uniform(-360, 360, (2, 200))
    expected = theta_i + np.abs(phi_i % 360 - 180) + 2 * theta_o + 3 * np.abs(phi_o % 360 - 180)
    values = material.evaluate(direction(theta_i, phi_i), direction(theta_o, phi_o))
    np.testing.assert_allclose(values, expected[:, None] * [1, 2, 3], rtol=1e-5)


def test_holds_its_last_elevation_to_the_horizon_and_is_dark_below(path):
    material = utia.load(read_file(write(path, numbered())))
    view = direction([30.0], [90.0])
    last = material.evaluate(direction([75.0], [15.0]), view)
    np.testing.assert_allclose(material.evaluate(direction([89.0], [15.0]), view), last, rtol=1e-6)
    assert not material.evaluate(direction([90.1], [15.0]), view).any()
    assert not material.evaluate(view, direction([120.0], [15.0])).any()


def test_negative_samples_become_zero_and_are_counted(path):
    samples = np.ones(utia.SHAPE)
    samples[1, 2, 3, 4, 5] = -0.5
    material = utia.load(read_file(write(path, samples)))
    assert material.table[1, 2, 3, 4, 5] == 0
    assert material.negative == pytest.approx((0, 1 / 288**2, 0))


def with_nan():
    samples = np.ones(utia.SHAPE)
    samples[2, 1, 2, 3, 4] = np.nan
    return samples.tobytes()


WRONG = {
    "short": (bytes(1000), r"^fabric.bin holds 1,000 bytes, a UTIA file has 1,990,656: .* cut short. Fetch it"),
    "long": (bytes(1_990_664), r"holds 1,990,664 bytes.*something was appended"),
    "NaN": (with_nan(), r"1 of 248,832 samples.*the blue plane, light \(15, 15\), view \(45, 30\) degrees"),
    "zeros": (bytes(1_990_656), r"no sample lies above 0"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_file_is_refused_with_what_to_do(path, case):
    content, message = WRONG[case]
    path.write_bytes(content)
    with pytest.raises(FittersError, match=message):
        utia.load(read_file(path))


def test_only_whole_tables_make_a_material():
    with pytest.raises(FittersError, match=r"not float64 \(3, 6, 48, 6, 47\)"):
        utia.AnisotropicMaterial("a", np.ones((3, 6, 48, 6, 47)), "s", "h", (0, 0, 0))
