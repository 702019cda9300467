"""The suite that ships in `fitters.testing.models`, on every entry of the registry, and what is known of some."""

import numpy as np
import pytest

from fitters.expressions import parse
from fitters.fitting import FitSettings
from fitters.grid import SHAPE, cell_directions
from fitters.models import KINDS, MODELS, FormulaFitter, FormulaModel, MeasuredTable, Model, power_iterations
from fitters.models.fitted import MaterialFit
from fitters.models.fitter import Family, MaterialFitter
from fitters.testing.models import VIEWS, check_fitter, check_model
from tests.fitters.models.conftest import GLOSSY, ROUGH
from tests.fitters.models.power_iterations.closed_forms import Surface

TABLES = [name for name, fitter in MODELS.items() if not fitter.together]
ONE_SIDED = "p0 / pi + p1 * wi.z * pow(wh.z, p2)"
BRUSHED = Surface("ggx", 0.5, 0.2, 0.6, fresnel=(0.9, 0.6, 0.3))
FLOATS = {
    "measured": 3 * 90 * 90 * 180,
    "ggx": 12,
    "cook-torrance": 12,
    # Table 2 of the factor paper, in floats of 4 bytes: 97,200, 3,264 and 4,344 bytes.
    "bivariate": 97_200 // 4,
    "npf-independent-g": 3_264 // 4,
    "npf-naive": 4_344 // 4,
    # without G, which follows from D
    "npf-g-from-d": 3_264 // 4 - 270,
    # six tables of 90
    "power-iterations": 540,
    # P, Q2 and G1 (90, 90), Q1 (90,), F (90, 3)
    "power-iterations-anisotropic": 3 * 8100 + 90 + 270,
}


@pytest.mark.parametrize("name", MODELS)
def test_every_entry_of_the_registry_passes_the_suite(name, problem_of):
    """All formulas sample by the same code: most have one view only."""
    views = VIEWS if name in FLOATS else (45,)
    fitted = check_fitter(MODELS[name], problem_of(GLOSSY), views)
    assert fitted.floats == FLOATS.get(name, fitted.floats)
    assert fitted.model.reciprocal or MODELS[name].together


@pytest.mark.parametrize("name", [*TABLES, "ggx"])
def test_models_of_a_rough_material_pass_the_suite(name, fitted):
    check_model(fitted(name, ROUGH), (45,))


@pytest.mark.long
@pytest.mark.parametrize("name", [name for name in MODELS if name not in FLOATS])
def test_every_formula_samples_as_it_says_at_all_views(name, problem_of):
    check_fitter(MODELS[name], problem_of(GLOSSY))


@pytest.mark.long
@pytest.mark.parametrize("name", [*TABLES, "ggx"])
def test_models_of_a_rough_material_sample_as_they_say_at_all_views(name, fitted):
    check_model(fitted(name, ROUGH))


def test_an_anisotropic_model_passes_the_suite():
    check_model(power_iterations.extract_anisotropic(BRUSHED.brdf).model)


def test_a_formula_that_is_not_reciprocal_says_so(problem_of):
    fitter = FormulaFitter.of_expression(parse(ONE_SIDED))
    model = fitter.fit(problem_of(GLOSSY), settings=FitSettings(starts=16), bounds=(1e-4, 1e3)).model
    assert not model.reciprocal
    check_model(model)


def test_every_kind_of_model_is_in_the_registry():
    """A class that no entry makes could be saved, but not be loaded."""

    def leaves(cls):
        return {leaf for sub in cls.__subclasses__() for leaf in (leaves(sub) | {sub})}

    known = {cls for cls in leaves(Model) if cls.__module__.startswith("fitters.") and "kind" in vars(cls)}
    assert known == set(KINDS.values())


class Grey(FormulaModel):
    """Says that it stores what it is, but evaluates to something else."""

    kind = "grey"

    def sample(self, w_o, u):
        return super().sample(w_o, 0.9 * np.asarray(u, np.float64))


def test_the_suite_refuses_samples_that_do_not_have_the_density():
    model = Grey(parse("p0"), np.full((3, 1), 0.1))
    with pytest.raises(AssertionError, match="do not have the density"):
        check_model(model, (45,))


def test_the_suite_refuses_an_entry_that_charts_cannot_draw(problem_of):
    odd = Family("odd", "odd", "red")
    fitter = MaterialFitter(
        "odd", odd, MeasuredTable, lambda material: MaterialFit(MeasuredTable(material.table)), ()
    )
    with pytest.raises((AssertionError, ValueError), match="odd"):
        check_fitter(fitter, problem_of(GLOSSY))


@pytest.mark.parametrize("material", [GLOSSY, ROUGH])
@pytest.mark.parametrize("name", ["npf-independent-g", "npf-g-from-d", "npf-naive", "bivariate", "measured"])
def test_cell_centres_read_what_was_fitted(fitted, name, material):
    """The papers' equations over the stored arrays, at the centres of the grid, up to 89 degrees."""
    model = fitted(name, material)
    w_i, w_o = (w[::101] for w in cell_directions())
    h, d, p = (index[::101] for index in np.unravel_index(np.arange(len(cell_directions()[0])), SHAPE))
    seen = np.minimum(w_i[:, 2], w_o[:, 2]) > np.cos(np.radians(89))
    arrays = model.arrays()
    if name == "measured":
        expected = arrays["table"][:, h, d, p].T
    elif name == "bivariate":
        expected = arrays["B"][h, d]
    else:
        factor = arrays["D"][h] * arrays["F"][d]
        if name == "npf-naive":
            factor = factor * arrays["H"][p]
        else:
            for w in (w_i, w_o):
                at = np.degrees(np.arccos(np.clip(w[:, 2], -1, 1)))
                g = np.stack([np.interp(at, np.arange(90), column) for column in arrays["G"].T], axis=-1)
                factor = factor * g / w[:, 2:]
        expected = arrays["rho_d"] + arrays["rho_s"] * factor
    np.testing.assert_allclose(model.evaluate(w_i, w_o)[seen], expected[seen], rtol=1e-9)
