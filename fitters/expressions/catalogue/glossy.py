"""Models made for glossy surfaces of the MERL database, whose highlights have wider tails than Beckmann's."""

from fitters.expressions.catalogue.published import Entry, Parameter
from fitters.expressions.catalogue.terms import DIFFUSE, SPECULAR, TAN2, V_CAVITY

_VH = "dot(wo, wh)"
_G = f"sqrt(max(0, p4 * p4 + {_VH} * {_VH} - 1))"  # 0 is total reflection
_DIELECTRIC = (
    f"pow(({_G} - {_VH}) / ({_G} + {_VH}), 2) / 2"
    f" * (1 + pow(({_VH} * ({_G} + {_VH}) - 1) / ({_VH} * ({_G} - {_VH}) + 1), 2))"
)

# F0 - F1 c + (1 - F0) (1 - c)^5 at c = V.H, sorted by F0 - F1, F0 and 1: none of the three factors is negative.
_SGD_FRESNEL = f"(p1 * {_VH} + p2 * (1 - {_VH} - pow(1 - {_VH}, 5)) + p3 * pow(1 - {_VH}, 5))"
_SGD_D = f"exp(-(p4 + {TAN2} / p4)) / (pow(p4 + {TAN2} / p4, p5 - 1) * pow(wh.z, 4))"
# asin(w.z) is pi / 2 - theta. 1 - exp is never above 0: what is clamped to [0, 1] needs but the lower end.
_SGD_G_I = "max(0, 1 + p6 * (1 - exp(pow(max(0, p9 - asin(wi.z)) / p7, p8))))"
_SGD_G_O = "max(0, 1 + p6 * (1 - exp(pow(max(0, p9 - asin(wo.z)) / p7, p8))))"


def _sgd_specular(meaning: str) -> Parameter:
    """A linear parameter that published fits have nearly at 0."""
    return Parameter(meaning, 1e-20, 1e6)


ENTRIES: list[Entry] = [
    (
        "abc",
        2012,
        "Low et al. 2012, the microfacet form: distribution A / (1 + B (1 - N.H))^C, V-cavity shadowing, "
        "Fresnel term of a dielectric as in Cook and Torrance 1982",
        f"p0 / pi + p1 / pi * {_DIELECTRIC} / pow(1 + p2 * (1 - wh.z), p3) * {V_CAVITY} / (wi.z * wo.z)",
        (
            DIFFUSE,
            Parameter("A: specular scale", SPECULAR.low, SPECULAR.high),
            Parameter("B: sharpness", 1.0, 1e8),
            Parameter("C: falloff of the tail", 1e-2, 10.0),
            Parameter("index of refraction", 1.01, 100.0),
        ),
    ),
    (
        "sgd",
        2012,
        "Bagher et al. 2012, shifted gamma distribution. In their symbols p1, p2, p3 are K rho_s / pi^2 times "
        "F0 - F1, F0 and 1 (the normalisation K is part of the scale), p7 is c^(-1/k), p9 is pi / 2 - theta_0",
        f"p0 / pi + {_SGD_FRESNEL} * {_SGD_D} * {_SGD_G_I} * {_SGD_G_O} / (wi.z * wo.z)",
        (
            DIFFUSE,
            _sgd_specular("specular scale at normal incidence"),
            _sgd_specular("specular scale between normal and grazing incidence"),
            _sgd_specular("specular scale at grazing incidence"),
            Parameter("alpha: roughness", 1e-5, 2.0),
            Parameter("1 + p: falloff of the tail", 1.0, 4.0),
            Parameter("lambda: depth of the shadowing", 1e-8, 1e8),
            Parameter("width of the onset of shadowing, radians", 0.2, 10.0),
            Parameter("k: steepness of the shadowing", 1.0, 1e3),
            Parameter("elevation below which there is shadowing, radians", 0.3, 2.5),
        ),
    ),
]
