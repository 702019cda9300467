"""Lobes of the Disney BRDF: Burley 2012, Physically-Based Shading at Disney.

Left out: tints, sheen, anisotropy and the subsurface diffuse lobe. A parameter is the value in one channel, so
metals and dielectrics differ in their reflectance; there is no switch.
"""

from fitters.expressions.catalogue.published import Entry, Parameter
from fitters.expressions.catalogue.terms import DIFFUSE, R0, SCHLICK_VH, SPECULAR

_FD90 = "(2 * dot(wo, wh) * dot(wo, wh) * p1 - 0.5)"  # less 1
_DIFFUSE_LOBE = f"p0 / pi * (1 + {_FD90} * pow(1 - wi.z, 5)) * (1 + {_FD90} * pow(1 - wo.z, 5))"
_GTR2 = "pow(p1, 4) / (pi * pow(1 - wh.z * wh.z + pow(p1, 4) * (wh.z * wh.z), 2))"
_GTR1 = "1 / (1 - wh.z * wh.z + p5 * p5 * (wh.z * wh.z))"


def _shadowing(alpha2: str) -> str:
    """G / (4 N.L N.V) of Smith for GGX, of the square of its roughness."""
    towards_light, towards_viewer = (
        f"({cosine} + sqrt({alpha2} + (1 - {alpha2}) * {cosine} * {cosine}))" for cosine in ("wi.z", "wo.z")
    )
    return f"({towards_light} * {towards_viewer})"


_BASE = f"{_DIFFUSE_LOBE} + p2 * {SCHLICK_VH} * ({_GTR2}) / {_shadowing('pow((1 + p1) / 2, 4)')}"
_COAT_FRESNEL = "(0.04 + 0.96 * pow(1 - dot(wo, wh), 5))"
_BASE_PARAMETERS = (DIFFUSE, Parameter("roughness", 0.01, 1.0), SPECULAR, R0)

ENTRIES: list[Entry] = [
    (
        "disney-diffuse",
        2012,
        "Burley 2012, section 5.3: diffuse, with retroreflection of rough surfaces",
        _DIFFUSE_LOBE,
        _BASE_PARAMETERS[:2],
    ),
    (
        "disney-specular",
        2012,
        "Burley 2012, sections 5.3 to 5.6: disney-diffuse and the primary specular lobe (GTR2, "
        "alpha = roughness^2, Smith shadowing with alpha = (1 / 2 + roughness / 2)^2); the scale p2 is 1 there",
        _BASE,
        _BASE_PARAMETERS,
    ),
    (
        "disney-clearcoat",
        2012,
        "Burley 2012: disney-specular and the clearcoat (GTR1, R0 = 0.04, shadowing with alpha = 0.25); its "
        "strength and normalisation, clearcoat / 4 (a^2 - 1) / (pi log a^2) with a = p5, are p4",
        f"{_BASE} + p4 * {_COAT_FRESNEL} * ({_GTR1}) / {_shadowing('0.0625')}",
        (
            *_BASE_PARAMETERS,
            Parameter("clearcoat scale", SPECULAR.low, SPECULAR.high),
            Parameter("clearcoat roughness alpha", 1e-3, 0.1),
        ),
    ),
]
