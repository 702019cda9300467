"""Reflection models from Lambert to GGX."""

from fitters.expressions.catalogue.published import Entry, Parameter
from fitters.expressions.catalogue.terms import (
    ALPHA,
    DIFFUSE,
    DIFFUSE_VALUE,
    R0,
    SCHLICK_VH,
    SPECULAR,
    TAN2,
    V_CAVITY,
)

_GGX_D = "p2 * p2 / (pi * pow(wh.z * wh.z * (p2 * p2 - 1) + 1, 2))"
_GGX_LAMBDA_I = "sqrt(p2 * p2 + (1 - p2 * p2) * wi.z * wi.z)"
_GGX_LAMBDA_O = "sqrt(p2 * p2 + (1 - p2 * p2) * wo.z * wo.z)"
_OREN_NAYAR_PHI = "(dot(wi, wo) - wi.z * wo.z)"

ENTRIES: list[Entry] = [
    ("lambert", 1760, "Lambert 1760", "p0 / pi", (DIFFUSE,)),
    (
        "phong",
        1975,
        "Phong 1975: ambient of no concern here; diffuse plus (R.V)^n",
        "p0 / pi + p1 * pow(max(dot(wr, wo), 0), p2)",
        (DIFFUSE, SPECULAR, Parameter("exponent", 0.1, 1e5)),
    ),
    (
        "blinn-phong",
        1977,
        "Blinn 1977: diffuse plus (N.H)^n",
        "p0 / pi + p1 * pow(dot(wn, wh), p2)",
        (DIFFUSE, SPECULAR, Parameter("exponent", 0.1, 1e6)),
    ),
    (
        "cook-torrance",
        1982,
        "Cook and Torrance 1982 as eq. 5 of the genBRDF paper (Schlick's Fresnel term in N.H)",
        "p0 + p1 * ((p3 + (1 - p3) * pow(1 - wh.z, 5)) / pi)"
        " * (1 / (p2 * p2 * pow(wh.z, 4)) * exp(-pow(tan(acos(wh.z)) / p2, 2)))"
        f" * {V_CAVITY} / (wi.z * wo.z)",
        (DIFFUSE_VALUE, SPECULAR, ALPHA, R0),
    ),
    (
        "ggx",
        2007,
        "Walter et al. 2007 with height-correlated Smith shadowing (Heitz 2014) and Schlick's Fresnel term",
        # D F G / (4 NL NV) with the correlated G folded in: 2 NL NV / (NL lambda_o + NV lambda_i)
        f"p0 + p1 * {SCHLICK_VH} * ({_GGX_D}) / (2 * (wi.z * {_GGX_LAMBDA_O} + wo.z * {_GGX_LAMBDA_I}))",
        (DIFFUSE_VALUE, SPECULAR, ALPHA, R0),
    ),
    (
        "beckmann",
        1963,
        "Beckmann and Spizzichino 1963 as a microfacet lobe, V-cavity shadowing, Schlick's Fresnel term in V.H",
        f"p0 + p1 * {SCHLICK_VH} * exp(-({TAN2}) / (p2 * p2)) / (pi * p2 * p2 * pow(wh.z, 4))"
        f" * {V_CAVITY} / (4 * wi.z * wo.z)",
        (DIFFUSE_VALUE, SPECULAR, ALPHA, R0),
    ),
    (
        "ward",
        1992,
        "Ward 1992, isotropic",
        f"p0 / pi + p1 * exp(-({TAN2}) / (p2 * p2)) / (4 * pi * p2 * p2 * sqrt(wi.z * wo.z))",
        (DIFFUSE, SPECULAR, ALPHA),
    ),
    (
        "ashikhmin-shirley",
        2000,
        "Ashikhmin and Shirley 2000, isotropic, diffuse term of their eq. 5 with R_s = p3",
        "p0 * 28 / (23 * pi) * (1 - p3) * (1 - pow(1 - wi.z / 2, 5)) * (1 - pow(1 - wo.z / 2, 5))"
        f" + p1 * (p2 + 1) / (8 * pi) * pow(wh.z, p2) / (dot(wo, wh) * max(wi.z, wo.z)) * {SCHLICK_VH}",
        (DIFFUSE, SPECULAR, Parameter("exponent", 0.1, 1e6), Parameter(R0.meaning, 0.01, 0.999)),
    ),
    (
        "oren-nayar",
        1994,
        "Oren and Nayar 1994, the qualitative model; sin alpha tan beta cos(phi_i - phi_o) = "
        "(w_i.w_o - NL NV) / max(NL, NV)",
        "p0 / pi * (1 - p1 * p1 / (2 * (p1 * p1 + 0.33))"
        f" + 0.45 * p1 * p1 / (p1 * p1 + 0.09) * max(0, {_OREN_NAYAR_PHI} / max(wi.z, wo.z)))",
        (DIFFUSE, Parameter("standard deviation of the slope angle, radians", 1e-3, 2.0)),
    ),
]
