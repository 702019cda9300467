"""The isotropic extraction against closed forms and an independent eigenvector."""

import numpy as np
import pytest
from scipy.integrate import quad

from fitters.models.power_iterations import TabulatedMicrofacet, isotropic
from fitters.models.power_iterations.conversion import isotropic_alphas
from fitters.models.power_iterations.slopes import clamped_mean, mean_square, quadrature, slopes
from tests.fitters.models.power_iterations.closed_forms import Surface, direction

TABLE_1 = {0.01: 0.03, 0.02: 0.004, 0.05: 0.002, 0.15: 0.0005}
KINDS = ("beckmann", "ggx")


def backscattering(surface, theta):
    w = direction(theta)
    return surface.brdf(w, w)[..., 0]


def extracted(surface, count=90):
    """The density and the model of a surface of ideal mirrors."""
    theta, cos_k = isotropic.nodes(count), isotropic.area_nodes(count)
    p, _ = isotropic.slope_pdf(backscattering(surface, theta))
    density = slopes(theta, p)
    area = isotropic.projected_area(density, cos_k)
    return density, TabulatedMicrofacet(theta, p, np.arccos(cos_k), cos_k / area, np.ones((90, 3)))


@pytest.mark.parametrize("alpha", TABLE_1)
def test_table_1_of_the_paper(alpha):
    """Backscattering of Beckmann surfaces at N = 360, between the nodes too, down to a millionth of the highlight.

    The model's own G at i = o is eq. 2, which is G1 / (2 - G1): the hotspot that section 4.1 leaves open.
    """
    surface = Surface("beckmann", alpha)
    _, model = extracted(surface, 360)
    theta = np.linspace(1e-4, np.pi / 2 - 1e-4, 40_000)
    expected = backscattering(surface, theta)
    seen = expected > 1e-6 * expected.max()
    w = direction(theta[seen])
    fit = model.evaluate(w, w)[:, 0] * (2 - surface.shadowing(w))
    assert np.max(np.abs(fit / expected[seen] - 1)) < TABLE_1[alpha]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("alpha", [0.1, 0.3, 0.7])
def test_distribution_and_shadowing_have_their_closed_form(kind, alpha):
    surface = Surface(kind, alpha)
    _, model = extracted(surface)
    normals = direction(model.theta)
    seen = model.ndf > 1e-8 * model.ndf.max()
    # The rectangle rule of the kernel leaves out GGX's slopes beyond 89 degrees.
    np.testing.assert_allclose(model.ndf[seen], surface.ndf(normals)[seen], rtol=2e-3)
    np.testing.assert_allclose(model.shadowing, surface.shadowing(direction(model.theta_k)), rtol=0.01)


def test_power_iterations_find_the_perron_vector():
    kernel = isotropic.kernel(backscattering(Surface("ggx", 0.4), isotropic.nodes(90)))
    values, vectors = np.linalg.eig(kernel)
    dominant = np.argmax(values.real)
    expected = np.abs(vectors[:, dominant].real)
    found = isotropic.dominant(kernel, 200, 1e-12)
    assert 4 < found.iterations < 60
    np.testing.assert_allclose(found.values, expected / expected.max(), rtol=1e-8)
    assert np.all(found.values >= 0)


def test_the_kernel_is_the_azimuthal_integral():
    for product in (0.0, 0.3, 1.0, 1.7, 40.0):
        expected = quad(lambda phi, x=product: max(0.0, 1 + x * np.cos(phi)), 0, np.pi, limit=200)[0] / np.pi
        assert clamped_mean(np.array(product)) == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize("kind", KINDS)
def test_the_density_is_normalised(kind):
    """Eq. 8 by an integral of its own: what the model evaluates, over all slopes."""
    density, model = extracted(Surface(kind, 0.3))
    assert density.total == pytest.approx(1, abs=1e-12)
    assert quadrature(density).weight.sum() == pytest.approx(1, abs=1e-9)
    theta = np.linspace(0, np.pi / 2, 400_001)[1:-1]
    # At theta_i = 0, pdf = D(h) cos_h / (4 cos_d) and d omega_i = 4 cos_d d omega_h: eq. 4.
    pdf = model.pdf(direction(2 * theta), np.tile([0.0, 0.0, 1.0], (len(theta), 1)))
    integral = np.trapezoid(pdf * 4 * np.cos(theta) * 2 * np.pi * np.sin(theta), theta)
    assert integral == pytest.approx(1, abs=1e-5)


def test_quantiles_are_the_cumulated_density():
    alpha = 0.3
    _, model = extracted(Surface("ggx", alpha))
    squared = np.tan(model.theta) ** 2
    np.testing.assert_allclose(model.quantiles, squared / (alpha**2 + squared), atol=2e-4)


@pytest.mark.parametrize("alpha", [0.05, 0.2, 0.6])
def test_conversion_recovers_alpha(alpha):
    beckmann, _ = isotropic_alphas(extracted(Surface("beckmann", alpha))[0])
    assert beckmann == pytest.approx(alpha, rel=5e-4)
    _, ggx = isotropic_alphas(extracted(Surface("ggx", alpha))[0])
    assert ggx == pytest.approx(alpha, rel=0.01)


def test_conversion_converges():
    """Beckmann's alpha with the square of the nodes' distance, GGX's with the tail beyond the last node."""
    coarse, fine = (
        (
            abs(isotropic_alphas(extracted(Surface("beckmann", 0.6), count)[0])[0] - 0.6),
            abs(isotropic_alphas(extracted(Surface("ggx", 0.6), count)[0])[1] - 0.6),
        )
        for count in (60, 240)
    )
    assert coarse[0] / fine[0] == pytest.approx(16, rel=0.1)
    assert coarse[1] / fine[1] == pytest.approx(4, rel=0.1)


def test_moments_are_those_of_a_fine_sum():
    density, model = extracted(Surface("beckmann", 0.4))
    tangent, weight = quadrature(density)
    slope = np.linspace(0, 8, 800_001)
    t = np.log1p(slope**2)
    p = np.exp(np.interp(t, density.t, density.log_p))
    for power in (1, 2):
        expected = np.trapezoid(2 * np.pi * slope ** (power + 1) * p, slope)
        assert tangent**power @ weight == pytest.approx(expected, rel=1e-6)
    assert mean_square(density) == pytest.approx(expected, rel=1e-6)
    assert model.slope_pdf == pytest.approx(np.exp(density.log_p[1:]))
