"""SGD and ABC with the parameters that their papers published for MERL, against a public reader of those fits."""

import ast
import re

import numpy as np
import pytest

from fitters.expressions import evaluate
from fitters.expressions.catalogue import CATALOGUE
from tests.reference_scene import SHARED

PI = np.pi
FITS = SHARED / "data/published_fits"
PUBLISHED = {"sgd": FITS / "bagher_sgd.fit", "abc": FITS / "low_lowmicrofacet_E2.fit"}
COLUMNS = {"sgd": slice(4, 7), "abc": slice(7, 10)}
MATERIALS = ("alum-bronze", "chrome", "gold-metallic-paint", "yellow-plastic")

REFLECT_NEGATIVELY = {"blue-fabric", "white-fabric2", "white-paint"}
"""F1 above F0: published SGD fits that are negative near normal incidence, which our ranges leave out."""

CHROME = {"alpha": [1.3e-4, 2e-4, 6e-5], "p": [0.3, 0.36, 0.26], "K": [2200.0, 2150.0, 4100.0]}
"""The distribution behind the reader's SGD values of chrome, which is not the published one.

Recovered from its values: with all else as published they give log D at 60 to 80 directions a channel, and its
three constants, which least squares finds to 1e-6, turn out to be these round numbers.
"""

pytestmark = pytest.mark.skipif(
    not all(path.exists() for path in PUBLISHED.values()), reason=f"no shared data in {SHARED}"
)


def lines(path):
    """Constants (.., 3) by name, `diffuse` and `specular` for the two albedos, by material."""
    found = {}
    for line in path.read_text().splitlines():
        if not line.startswith("#"):
            material, model = line.split(" = ", 1)
            diffuse, lobe = re.fullmatch(r"Aggregate\(Lambertian\((.*)\), \w+\((.*)\)\)", model).groups()
            found[material] = {"diffuse": constants(diffuse)["albedo"], **constants(lobe)}
            assert re.sub(r"[\w ]+ = |[][, \d.e+-]", "", f"{diffuse}, {lobe}") == ""
    return found


def constants(text):
    return {
        name: np.array(ast.literal_eval(value))
        for name, value in re.findall(r"(\w+) = (\[\[.*?\]\]|\[.*?\]|[^,]+)", text)
    }


def sgd(fit):
    """The formula's parameters, each (3,)."""
    f0, f1 = fit["eta"]
    scale = fit["K"] * fit["albedo"] / PI**2
    onset = np.exp(-np.log(fit["c"]) / fit["k"])
    lobe = (fit["alpha"], fit["p"] + 1, fit["Lambda"], onset, fit["k"], PI / 2 - fit["theta0"])
    return named(fit["diffuse"], scale * (f0 - f1), scale * f0, scale, *lobe)


def abc(fit):
    return named(fit["diffuse"], *(fit[name] + np.zeros(3) for name in ("A", "B", "C", "eta")))


def named(*values):
    return {f"p{i}": value for i, value in enumerate(values)}


TRANSLATED = {"sgd": sgd, "abc": abc}


def directions(theta, phi):
    """Unit vectors (n, 3, 3) of angles (n,) in degrees, the same in all three channels."""
    theta, phi = np.radians(theta), np.radians(phi)
    w = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    return np.repeat(w[:, None], 3, axis=1)


@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize("model", PUBLISHED)
def test_a_public_reader_of_the_published_fits_has_the_same_values(model, material):
    """To the digits that are printed: SGD's constants have six, Low's A five decimals, his albedos four."""
    table = np.loadtxt(FITS / f"sgd_abc_{material}.txt")
    fit = lines(PUBLISHED[model])[material]
    if (model, material) == ("sgd", "chrome"):
        fit |= {name: np.array(values) for name, values in CHROME.items()}
    w_i, w_o = directions(*table[:, :2].T), directions(*table[:, 2:4].T)
    found = evaluate(CATALOGUE[model].expression, TRANSLATED[model](fit), w_i, w_o)
    decimals = 0.5e-4 / PI if model == "abc" else 0.0
    np.testing.assert_allclose(found, table[:, COLUMNS[model]], rtol=1e-4, atol=1.01 * decimals)


@pytest.mark.parametrize("model", PUBLISHED)
def test_the_ranges_hold_every_published_fit(model):
    """But for diffuse albedos that are printed as 0, and for what is negative."""
    fits = lines(PUBLISHED[model])
    assert len(fits) == 100
    outside = set()
    for material, fit in fits.items():
        parameters = TRANSLATED[model](fit)
        parameters["p0"] = np.maximum(parameters["p0"], 1e-5)
        for name, (low, high) in CATALOGUE[model].bounds.items():
            if not np.all((parameters[name] >= low) & (parameters[name] <= high)):
                outside.add((material, name))
    assert outside == ({(material, "p1") for material in REFLECT_NEGATIVELY} if model == "sgd" else set())


@pytest.mark.parametrize("model", PUBLISHED)
def test_every_published_fit_within_the_ranges_is_a_brdf(model):
    """Finite and not negative in all directions to within 0.01 degrees of grazing."""
    rng = np.random.default_rng(6)
    theta = np.concatenate([rng.uniform(0, 90, 400), [0.0, 0.0, 89.99, 89.99, 45.0]])
    phi = np.concatenate([rng.uniform(0, 360, 400), [0.0, 0.0, 0.0, 180.0, 0.0]])
    w_o = directions(theta, phi)
    for material, fit in lines(PUBLISHED[model]).items():
        if material not in REFLECT_NEGATIVELY:
            for w_i in (directions(np.roll(theta, 7), np.roll(phi, 7)), w_o, w_o * [-1, -1, 1]):
                values = evaluate(CATALOGUE[model].expression, TRANSLATED[model](fit), w_i, w_o)
                assert np.all(np.isfinite(values) & (values >= 0)), material
