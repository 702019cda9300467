"""The image metrics against closed forms, published test data and other programs."""

import re
import subprocess
import sys

import numpy as np
import pytest
from skimage.color import deltaE_ciede2000, rgb2lab

from fitters.errors import FittersError
from fitters.judging.metrics import IMAGE_METRICS
from fitters.judging.metrics.images import delta_e_itp, ictcp, lab_difference
from fitters.rendering import Picture
from fitters.rendering.picture import MIDDLE_GREY, displayed, exposure, srgb

SIZE = 48
SHOWN = ["1-ssim", "delta-e-2000", "flip"]


def picture(pixels, foreground):
    return Picture(np.where(foreground[..., None], pixels, 0.0), foreground)


def whole(value):
    """A grey picture without background."""
    return Picture(np.full((SIZE, SIZE, 3), float(value)), np.ones((SIZE, SIZE), bool))


@pytest.fixture(scope="module")
def disc():
    x, y = np.meshgrid(np.linspace(-1, 1, SIZE), np.linspace(-1, 1, SIZE))
    return x**2 + y**2 < 0.99


@pytest.fixture(scope="module")
def truth(disc):
    """A coloured gradient with a small, bright window."""
    x, y = np.meshgrid(np.linspace(0, 1, SIZE), np.linspace(0, 1, SIZE))
    pixels = np.stack([0.1 + x, 0.2 + 0.5 * y, 0.4 - 0.3 * x * y], axis=-1)
    pixels[10:14, 20:24] += [60.0, 50.0, 40.0]
    return picture(pixels, disc)


def noisy(truth, amount):
    noise = np.random.default_rng(7).standard_normal(truth.pixels.shape)
    return Picture(truth.pixels * np.maximum(1 + amount * noise, 0), truth.foreground)


def value(name, truth, model):
    return IMAGE_METRICS[name].compare(truth, model).value


def grey_pair(first, second):
    """Two grey pictures that are displayed as `first` and `second`, linear: an exposure turns 0.18 into them."""
    radiance = np.log2(1 - np.array([first, second])) / np.log2(1 - MIDDLE_GREY)
    truth, model = (whole(level).pixels for level in radiance)
    # The larger part of the truth is middle grey, and is left as it is.
    truth[: SIZE // 2 + 1] = model[: SIZE // 2 + 1] = 1.0
    return tuple(Picture(pixels, np.ones((SIZE, SIZE), bool)) for pixels in (truth, model))


def inside(comparison):
    """A pixel that no window connects with another part of a `grey_pair`."""
    return comparison.per_pixel[SIZE * 3 // 4, SIZE // 2]


def test_a_constant_offset_has_the_psnr_and_the_l2_of_their_definitions(disc, truth):
    model = picture(truth.pixels + 0.25, disc)
    count = 3 * disc.sum()
    assert value("psnr", truth, model) == pytest.approx(20 * np.log10(truth.pixels.max() / 0.25))
    assert value("l2", truth, model) == pytest.approx(0.25 * np.sqrt(count) / np.sqrt(np.sum(truth.pixels**2)))


def test_a_brighter_model_has_the_l2_by_which_it_is_brighter(truth):
    assert value("l2", truth, Picture(1.1 * truth.pixels, truth.foreground)) == pytest.approx(0.1)


def test_the_peak_of_psnr_is_that_of_the_truth(disc):
    pixels = np.zeros((SIZE, SIZE, 3))
    pixels[disc] = [4.0, 1.0, 0.0]
    assert value("psnr", picture(pixels, disc), picture(pixels + 0.4, disc)) == pytest.approx(20.0)
    assert value("psnr", picture(pixels, disc), picture(pixels - 0.4, disc)) == pytest.approx(20.0)


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [
        ((50.0, 2.6772, -79.7751), (50.0, 0.0, -82.7485), 2.0425),
        ((50.0, 0.0, 0.0), (50.0, -1.0, 2.0), 2.3669),
        ((50.0, 2.5, 0.0), (73.0, 25.0, -18.0), 27.1492),
        ((60.2574, -34.0099, 36.2677), (60.4626, -34.1751, 39.4387), 1.2644),
        ((90.9257, -0.5406, -0.9208), (88.6381, -0.8985, -0.7239), 1.5381),
        ((2.0776, 0.0795, -1.1350), (0.9033, -0.0636, -0.5514), 0.9082),
    ],
)
def test_ciede2000_of_published_pairs(first, second, expected):
    """Sharma, Wu and Dalal 2005, table 1: pairs 1, 7, 17, 25, 32 and 34."""
    assert lab_difference(np.array([first]), np.array([second]))[0] == pytest.approx(expected, abs=5e-5)


def test_the_colour_difference_of_pictures_is_that_of_another_program(truth):
    model = noisy(truth, 0.2)
    first, second = (rgb2lab(displayed(seen, exposure(truth))) for seen in (truth, model))
    expected = deltaE_ciede2000(first, second)
    found = IMAGE_METRICS["delta-e-2000"].compare(truth, model)
    np.testing.assert_allclose(found.per_pixel, expected, atol=0.02)
    assert found.value == pytest.approx(expected[truth.foreground].mean(), rel=1e-3)


def test_white_of_203_and_100_candela_lie_where_bt_2408_has_them():
    """BT.2408: 203 cd/m^2 is 58 % of PQ; ST 2084 puts 100 cd/m^2 at 0.5081."""
    levels = ictcp(np.array([[203.0] * 3, [100.0] * 3, [1e5] * 3]))
    np.testing.assert_allclose(levels[:, 0], [0.5807, 0.5081, 1.0], atol=1e-4)
    np.testing.assert_allclose(levels[:, 1:], 0, atol=1e-4)


def test_delta_e_itp_is_that_of_the_recommendations():
    """BT.2124, annex 1, over BT.2100's PQ and ICtCp and the primaries of BT.2087."""
    first, second = np.random.default_rng(3).uniform(0, 900, (2, 50, 3))

    def itp(light):
        wide = light @ np.array([[0.6274, 0.3293, 0.0433], [0.0691, 0.9195, 0.0114], [0.0164, 0.0880, 0.8956]]).T
        lms = wide @ np.array([[1688, 2146, 262], [683, 2951, 462], [99, 309, 3688]]).T / 4096
        y = (lms / 10000) ** (2610 / 16384)
        pq = ((3424 / 4096 + 2413 / 128 * y) / (1 + 2392 / 128 * y)) ** (2523 / 32)
        found = pq @ np.array([[2048, 2048, 0], [6610, -13613, 7003], [17933, -17390, -543]]).T / 4096
        return found * [1, 0.5, 1]

    expected = 720 * np.linalg.norm(itp(first) - itp(second), axis=-1)
    np.testing.assert_allclose(delta_e_itp(first, second), expected, rtol=2e-3)


def test_shadows_are_as_bright_for_itp_as_on_the_display():
    """A grey far below middle grey, where the tone curve is straight: linear display light times 203 cd/m^2."""
    truth, model = grey_pair(0.002, 0.004)
    found = inside(IMAGE_METRICS["delta-e-itp"].compare(truth, model))
    expected = delta_e_itp(np.full((1, 3), 203 * 0.002), np.full((1, 3), 203 * 0.004))[0]
    assert found == pytest.approx(expected, rel=0.01)


def test_ssim_of_constant_greys_is_its_luminance_term():
    """Wang et al. 2004, eq. 6, with C1 = (0.01)^2: there is neither contrast nor structure."""
    truth, model = grey_pair(0.5, 0.2)
    a, b = srgb(np.array([0.5, 0.2]))
    expected = 1 - (2 * a * b + 1e-4) / (a**2 + b**2 + 1e-4)
    assert inside(IMAGE_METRICS["1-ssim"].compare(truth, model)) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(("first", "second"), [(0.18, 0.25), (0.05, 0.9)])
def test_flip_of_constant_greys_is_its_colour_term(first, second):
    """Andersson et al. 2020, sections 4.1.2 and 4.1.3: HyAB to the power 0.7, remapped; no edge, no point.

    Greys differ in L* alone; the scale is the distance of green and blue after the Hunt adjustment.
    """

    def lightness(y):
        return 116 * (np.cbrt(y) if y > (6 / 29) ** 3 else y / (3 * (6 / 29) ** 2) + 4 / 29) - 16

    def hunt(lab):
        return np.array([lab[0], 0.01 * lab[0] * lab[1], 0.01 * lab[0] * lab[2]])

    green, blue = hunt((87.735, -86.183, 83.180)), hunt((32.297, 79.188, -107.860))
    largest = (abs(green[0] - blue[0]) + np.hypot(*(green - blue)[1:])) ** 0.7
    distance, knee = abs(lightness(first) - lightness(second)) ** 0.7, 0.4 * largest
    expected = np.interp(distance, [0, knee, largest], [0, 0.95, 1])
    found = inside(IMAGE_METRICS["flip"].compare(*grey_pair(first, second)))
    assert found == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("name", IMAGE_METRICS)
def test_equal_pictures_are_best(name, truth):
    comparison = IMAGE_METRICS[name].compare(truth, truth)
    best = np.inf if IMAGE_METRICS[name].better == "higher" else 0
    assert comparison.value == pytest.approx(best, abs=1e-12)
    np.testing.assert_allclose(comparison.per_pixel, 0, atol=1e-12)


@pytest.mark.parametrize("name", IMAGE_METRICS)
def test_more_noise_is_worse(name, truth):
    found = [value(name, truth, noisy(truth, amount)) for amount in (0.01, 0.05, 0.2)]
    assert found == sorted(found, reverse=IMAGE_METRICS[name].better == "higher")
    assert len(set(found)) == 3


@pytest.mark.parametrize("name", IMAGE_METRICS)
def test_the_scale_of_the_light_does_not_matter(name, truth):
    model = noisy(truth, 0.1)
    brighter = [Picture(1000 * seen.pixels, seen.foreground) for seen in (truth, model)]
    assert value(name, *brighter) == pytest.approx(value(name, truth, model), rel=1e-5)


@pytest.mark.parametrize("name", IMAGE_METRICS)
def test_the_size_of_the_background_does_not_matter(name, truth):
    model = noisy(truth, 0.1)
    larger = [
        Picture(np.pad(seen.pixels, ((30, 4), (0, 9), (0, 0))), np.pad(seen.foreground, ((30, 4), (0, 9))))
        for seen in (truth, model)
    ]
    found, expected = IMAGE_METRICS[name].compare(*larger), IMAGE_METRICS[name].compare(truth, model)
    assert found.value == pytest.approx(expected.value, rel=1e-5)
    np.testing.assert_allclose(found.per_pixel[30:-4, :-9], expected.per_pixel, atol=1e-5)


@pytest.mark.parametrize("name", IMAGE_METRICS)
def test_pictures_of_the_same_exposure_norm_and_peak_may_change_places(name, truth):
    model = Picture(truth.pixels[:, ::-1].copy(), truth.foreground[:, ::-1].copy())
    assert value(name, truth, model) == pytest.approx(value(name, model, truth), rel=1e-5)


@pytest.mark.parametrize("name", IMAGE_METRICS)
def test_the_error_is_shown_where_it_is(name, truth):
    pixels = truth.pixels.copy()
    pixels[30, 25] *= 1.5
    found = IMAGE_METRICS[name].compare(truth, Picture(pixels, truth.foreground))
    assert np.unravel_index(np.argmax(found.per_pixel), found.per_pixel.shape) == (30, 25)


def test_errors_of_pixels_add_up_to_the_value(truth):
    model = noisy(truth, 0.1)
    seen = truth.foreground
    found = {name: metric.compare(truth, model) for name, metric in IMAGE_METRICS.items()}
    assert np.linalg.norm(found["l2"].per_pixel) == pytest.approx(found["l2"].value)
    assert -10 * np.log10(found["psnr"].per_pixel[seen].mean()) == pytest.approx(found["psnr"].value)
    for name in (*SHOWN, "delta-e-itp"):
        assert found[name].per_pixel[seen].mean() == pytest.approx(found[name].value)
        assert not found[name].per_pixel[~seen].any()


def test_the_median_is_shown_as_middle_grey_whatever_the_window_is_like(disc):
    pixels = np.full((SIZE, SIZE, 3), 0.02)
    pixels[20:26, 20:26] = 1e5
    shown = displayed(picture(pixels, disc), exposure(picture(pixels, disc)))
    # 118 of 255 is what 18 % grey is in sRGB.
    np.testing.assert_array_equal(np.round(255 * shown[40, 24]), 118)
    np.testing.assert_allclose(shown[22, 22], 1)


def test_the_tone_curve_is_that_of_the_factor_paper(disc):
    """output = pow(1 - exp2(-exposure * pixel), 1/gamma), with the curve of sRGB, which is near gamma 2.2."""
    pixels = np.linspace(0, 3, SIZE * SIZE * 3).reshape(SIZE, SIZE, 3)
    seen = picture(pixels, np.ones_like(disc))
    np.testing.assert_allclose(displayed(seen, 0.7), (1 - np.exp2(-0.7 * pixels)) ** (1 / 2.2), atol=0.034)


def test_every_protocol_names_mask_exposure_and_colours():
    assert {"l2", "psnr", "1-ssim", "delta-e-2000", "delta-e-itp", "flip"} <= set(IMAGE_METRICS)
    for metric in IMAGE_METRICS.values():
        assert "foreground" in metric.protocol
        assert "exposure" in metric.protocol
        assert re.search("linear RGB|sRGB|ICtCp", metric.protocol)


def test_what_cannot_be_compared_is_refused(truth, disc):
    with pytest.raises(FittersError, match="different foregrounds"):
        value("l2", truth, whole(1))
    black = Picture(np.zeros_like(truth.pixels), disc)
    for name in IMAGE_METRICS:
        with pytest.raises(FittersError, match="true picture is black"):
            value(name, black, truth)


@pytest.mark.parametrize(
    ("pixels", "foreground", "message"),
    [
        (np.full((2, 2, 3), np.nan), np.ones((2, 2), bool), "12 values are NaN or infinite"),
        (np.ones((2, 2, 3)), np.zeros((2, 2), bool), "no pixel shows the object"),
        (np.ones((2, 2, 3)), np.eye(2, dtype=bool), "outside the foreground"),
        (np.ones((2, 2)), np.ones((2, 2), bool), "pixels are float64"),
        (np.ones((2, 2, 3)), np.ones((3, 2), bool), "a foreground is bool"),
    ],
)
def test_a_picture_that_is_none_is_refused(pixels, foreground, message):
    with pytest.raises(FittersError, match=message):
        Picture(pixels, foreground)


def test_the_colour_library_is_loaded_late_and_silently():
    program = (
        "import sys, numpy as np, fitters.rendering as r\n"
        "from fitters.judging.metrics import IMAGE_METRICS\n"
        "assert 'colour' not in sys.modules\n"
        "seen = r.Picture(np.ones((4, 4, 3)), np.ones((4, 4), bool))\n"
        "for name in ('delta-e-2000', 'delta-e-itp'): IMAGE_METRICS[name].compare(seen, seen)\n"
    )
    done = subprocess.run([sys.executable, "-W", "always", "-c", program], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
