"""Lights from .hdr and .exr files, and the errors that bad files deserve."""

import numpy as np
import OpenImageIO as oiio
import pytest

from fitters.errors import FittersError
from fitters.scenes import load_light


def write(path, pixels, names=None, orientation=None):
    pixels = np.ascontiguousarray(pixels, dtype=np.float32)
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], oiio.FLOAT)
    if names:
        spec.channelnames = names
    if orientation:
        spec.attribute("Orientation", orientation)
    output = oiio.ImageOutput.create(str(path))
    assert output.open(str(path), spec)
    assert output.write_image(pixels)
    assert output.close()
    return path


@pytest.fixture
def pixels():
    """Values (32, 64, 3) over five decades, as float32."""
    return (10 ** np.random.default_rng(3).uniform(-2, 3, size=(32, 64, 3))).astype(np.float32)


def refusal(path):
    with pytest.raises(FittersError) as caught:
        load_light(str(path))
    assert str(path) in str(caught.value)
    return str(caught.value)


def test_exr_keeps_every_float(tmp_path, pixels):
    np.testing.assert_array_equal(load_light(str(write(tmp_path / "a.exr", pixels))).radiance, pixels)


def test_hdr_keeps_the_eight_bits_of_its_shared_exponent(tmp_path, pixels):
    radiance = load_light(str(write(tmp_path / "a.hdr", pixels))).radiance
    assert radiance.max() > 255
    assert np.max(np.abs(radiance - pixels) / pixels.max(axis=-1, keepdims=True)) <= 2 / 256


def test_channels_are_found_by_name(tmp_path, pixels):
    five = np.dstack([np.full((32, 64), -7.0), pixels[..., ::-1], np.ones((32, 64))])
    path = write(tmp_path / "a.exr", five, ("Z", "B", "G", "R", "A"))
    np.testing.assert_array_equal(load_light(str(path)).radiance, pixels)


def test_a_relative_path_starts_at_base(tmp_path, pixels):
    write(tmp_path / "a.exr", pixels)
    np.testing.assert_array_equal(load_light("a.exr", base=tmp_path).radiance, pixels)


def test_missing_file_and_folder(tmp_path):
    assert "no such file" in refusal(tmp_path / "none.hdr")
    assert "is a folder" in refusal(tmp_path)


@pytest.mark.parametrize("suffix", ["hdr", "exr"])
@pytest.mark.parametrize("share", [0.0, 0.005, 0.3, 0.9])
def test_cut_short(tmp_path, pixels, suffix, share):
    path = write(tmp_path / f"a.{suffix}", pixels)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    message = refusal(path)
    assert "cut short or damaged" in message or "cannot be read as an image" in message


def test_text_under_an_image_name(tmp_path):
    path = tmp_path / "a.hdr"
    path.write_text("<html>404</html>")
    assert "cannot be read as an image" in refusal(path)


def test_wrong_aspect_names_both_sides(tmp_path, pixels):
    assert "has 60 x 32 pixels" in refusal(write(tmp_path / "a.exr", pixels[:, :60]))


@pytest.mark.parametrize("names", [("Y",), ("Y", "A"), ("X", "Y", "Z")])
def test_missing_colour_channels(tmp_path, pixels, names):
    message = refusal(write(tmp_path / "a.exr", pixels[..., : len(names)], names))
    assert f"has the channels {', '.join(names)}" in message


def test_an_image_without_linear_radiance(tmp_path, pixels):
    assert "is a png image" in refusal(write(tmp_path / "a.png", pixels))


def test_a_flipped_image(tmp_path, pixels):
    assert "turned or flipped" in refusal(write(tmp_path / "a.exr", pixels, orientation=4))


def test_a_cropped_image(tmp_path, pixels):
    spec = oiio.ImageSpec(64, 32, 3, oiio.FLOAT)
    spec.full_width, spec.full_height = 128, 64
    output = oiio.ImageOutput.create("a.exr")
    assert output.open(str(tmp_path / "a.exr"), spec)
    assert output.write_image(pixels)
    assert output.close()
    assert "crop" in refusal(tmp_path / "a.exr")


def test_black(tmp_path, pixels):
    assert "every texel is black" in refusal(write(tmp_path / "a.hdr", 0 * pixels))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_finite_are_counted(tmp_path, pixels, value):
    pixels[3, 4:6, 1] = value
    assert "2 of 6144 values are NaN or infinite" in refusal(write(tmp_path / "a.exr", pixels))


def test_negative_values_are_counted(tmp_path, pixels):
    pixels[3, 4, 1] = -0.5
    message = refusal(write(tmp_path / "a.exr", pixels))
    assert "1 of 6144 values are negative, down to -0.5" in message


def test_negligible_negative_values_read_as_zero(tmp_path, pixels):
    pixels[3, 4, 1] = -0.9e-4 * pixels.mean()
    assert load_light(str(write(tmp_path / "a.exr", pixels))).radiance[3, 4, 1] == 0
