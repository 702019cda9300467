"""The reference settings give what the paper's own implementation gives (its public code, float64, 90 nodes)."""

import importlib.util
import sys

import numpy as np
import pytest

from fitters.materials.material import from_samples
from fitters.models.power_iterations import Settings, extract
from tests.fitters.models.power_iterations.closed_forms import direction
from tests.shared_data import SHARED

NUMBERS = SHARED / "data/power_iterations_reference"
NETWORKS = SHARED / "data/merl/nbrdf.npz"
SYNTHETIC = {
    "synth-ggx02": (0.2, (0.9, 0.9, 0.9), (0.05, 0.03, 0.02)),
    "synth-ggx05": (0.5, (0.04, 0.05, 0.06), (0.4, 0.2, 0.1)),
}
SURROGATES = ("alum-bronze", "gold-paint", "pure-rubber", "pvc", "two-layer-gold")

pytestmark = pytest.mark.skipif(
    not (NUMBERS.is_dir() and NETWORKS.exists() and (SHARED / "tools/merl_synthetic.py").exists()),
    reason=f"no shared data in {SHARED}",
)


@pytest.fixture(scope="module")
def tools():
    """The programs that wrote the materials; one imports the other by its plain name."""
    loaded, before = {}, dict(sys.modules)
    for name in ("merl_surrogate", "merl_synthetic"):
        spec = importlib.util.spec_from_file_location(name, SHARED / f"tools/{name}.py")
        loaded[name] = importlib.util.module_from_spec(spec)
        sys.modules[name] = loaded[name]
        spec.loader.exec_module(loaded[name])
    sys.modules.pop("merl_surrogate")
    sys.modules.pop("merl_synthetic")
    assert set(sys.modules) >= set(before)
    return loaded


@pytest.fixture(scope="module", params=[*SYNTHETIC, *SURROGATES])
def case(request, tools):
    """The name of a material, and its table."""
    name = request.param
    if name in SYNTHETIC:
        samples = tools["merl_synthetic"].brdf(*SYNTHETIC[name])
    else:
        weights = dict(np.load(NETWORKS))
        samples = tools["merl_surrogate"].table(weights, [str(n) for n in weights["names"]].index(name))
    return name, from_samples(name, samples, source="test", sha256=name)


@pytest.fixture(scope="module")
def repeated(case):
    name, material = case
    return name, extract(material, Settings.reference())


def numbers(name, what):
    return np.loadtxt(NUMBERS / f"{name}_{what}.txt")


def test_distribution_and_shadowing(repeated):
    name, found = repeated
    _, _, theta, p, d = numbers(name, "ndf").T
    np.testing.assert_allclose(np.degrees(found.model.theta), theta, atol=1e-6)
    np.testing.assert_allclose(found.model.slope_pdf, p, rtol=1e-6)
    np.testing.assert_allclose(found.model.ndf, d, rtol=1e-6)
    _, _, sigma, g1 = numbers(name, "sigma").T
    np.testing.assert_allclose(found.model.shadowing[:-1], g1[:-1], rtol=1e-6)
    np.testing.assert_allclose(np.cos(found.model.theta_k) / found.model.shadowing, sigma, rtol=1e-6)


def test_roughness(repeated):
    name, found = repeated
    np.testing.assert_allclose((found.alpha_beckmann, found.alpha_ggx), numbers(name, "alpha"), rtol=1e-6)


def test_fresnel_and_evaluations(repeated):
    """To 1e-6 where both cells beside phi_d = 90 degrees agree, as in the synthetic tables, else to 4e-3."""
    name, found = repeated
    np.testing.assert_allclose(found.fresnel, numbers(name, "fresnel")[:, 2:], rtol=4e-3)
    if name in SYNTHETIC:
        np.testing.assert_allclose(found.fresnel, numbers(name, "fresnel")[:, 2:], rtol=1e-6)
    pairs = numbers(name, "eval")
    theta_i, phi_i, theta_o, phi_o = np.radians(pairs[:, :4]).T
    values = found.model.evaluate(direction(theta_i, phi_i), direction(theta_o, phi_o))
    np.testing.assert_allclose(values, pairs[:, 7:10], rtol=5e-3)
    assert np.median(np.abs(values / pairs[:, 7:10] - 1)) < 5e-4


def test_the_default_stays_near(case):
    """What the better quadrature changes: some per cent of the roughness, less of the distribution."""
    name, material = case
    found = extract(material)
    beckmann, ggx = numbers(name, "alpha")
    assert found.alpha_ggx == pytest.approx(ggx, rel=0.03)
    assert found.alpha_beckmann == pytest.approx(beckmann, rel=0.08)
    # Node i of both rests on bin i, but for the first, which the truncation there gives to bin 0.
    same_bin = slice(5, 60)
    np.testing.assert_allclose(found.model.slope_pdf[same_bin], numbers(name, "ndf")[same_bin, 3], rtol=0.03)
