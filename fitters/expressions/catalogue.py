"""Published BRDFs in the text form: where a search starts, what its codebank holds, and what it must beat.

Notation: `wi.z`, `wo.z`, `wh.z` are N.L, N.V, N.H; `dot(wo, wh)` is V.H; delta, the angle between N and H, is
`acos(wh.z)`. Values are sr^-1. A parameter's range is what a fit may use, wide enough for every MERL material.
"""

import difflib
from dataclasses import dataclass

from fitters.errors import FittersError
from fitters.expressions.expression import Expression
from fitters.expressions.text import parse


@dataclass(frozen=True)
class Parameter:
    """What a parameter means and the closed interval that a fit searches."""

    meaning: str
    low: float
    high: float


@dataclass(frozen=True)
class Formula:
    """A published BRDF: `parameters[i]` describes `p{i}`. Raises `FittersError` where the two disagree."""

    name: str
    source: str
    expression: Expression
    parameters: tuple[Parameter, ...]

    def __post_init__(self) -> None:
        described = tuple(f"p{i}" for i in range(len(self.parameters)))
        if self.expression.parameters != described:
            raise FittersError(f"{self.name} uses {self.expression.parameters}, but {described} are described")

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        return {f"p{i}": (p.low, p.high) for i, p in enumerate(self.parameters)}


_DIFFUSE = Parameter("diffuse albedo", 1e-5, 10.0)
_DIFFUSE_VALUE = Parameter("diffuse value, sr^-1", 1e-6, 10.0)
_SPECULAR = Parameter("specular scale", 1e-6, 1e6)
_R0 = Parameter("reflectance at normal incidence", 0.01, 1.0)
_ALPHA = Parameter("roughness", 1e-3, 2.0)

_TAN2 = "(1 - wh.z * wh.z) / (wh.z * wh.z)"
_SCHLICK_VH = "(p3 + (1 - p3) * pow(1 - dot(wo, wh), 5))"
_BECKMANN_G = "min(1, min(2 * wh.z * wo.z / dot(wo, wh), 2 * wh.z * wi.z / dot(wo, wh)))"
_GGX_D = "p2 * p2 / (pi * pow(wh.z * wh.z * (p2 * p2 - 1) + 1, 2))"
_GGX_LAMBDA_I = "sqrt(p2 * p2 + (1 - p2 * p2) * wi.z * wi.z)"
_GGX_LAMBDA_O = "sqrt(p2 * p2 + (1 - p2 * p2) * wo.z * wo.z)"
_OREN_NAYAR_PHI = "(dot(wi, wo) - wi.z * wo.z)"

_ENTRIES = [
    ("lambert", "Lambert 1760", "p0 / pi", (_DIFFUSE,)),
    (
        "phong",
        "Phong 1975: ambient of no concern here; diffuse plus (R.V)^n",
        "p0 / pi + p1 * pow(max(dot(wr, wo), 0), p2)",
        (_DIFFUSE, _SPECULAR, Parameter("exponent", 0.1, 1e5)),
    ),
    (
        "blinn-phong",
        "Blinn 1977: diffuse plus (N.H)^n",
        "p0 / pi + p1 * pow(dot(wn, wh), p2)",
        (_DIFFUSE, _SPECULAR, Parameter("exponent", 0.1, 1e6)),
    ),
    (
        "cook-torrance",
        "Cook and Torrance 1982 as eq. 5 of the genBRDF paper (Schlick's Fresnel term in N.H)",
        "p0 + p1 * ((p3 + (1 - p3) * pow(1 - wh.z, 5)) / pi)"
        " * (1 / (p2 * p2 * pow(wh.z, 4)) * exp(-pow(tan(acos(wh.z)) / p2, 2)))"
        f" * {_BECKMANN_G} / (wi.z * wo.z)",
        (_DIFFUSE_VALUE, _SPECULAR, _ALPHA, _R0),
    ),
    (
        "ggx",
        "Walter et al. 2007 with height-correlated Smith shadowing (Heitz 2014) and Schlick's Fresnel term",
        # D F G / (4 NL NV) with the correlated G folded in: 2 NL NV / (NL lambda_o + NV lambda_i)
        f"p0 + p1 * {_SCHLICK_VH} * ({_GGX_D}) / (2 * (wi.z * {_GGX_LAMBDA_O} + wo.z * {_GGX_LAMBDA_I}))",
        (_DIFFUSE_VALUE, _SPECULAR, _ALPHA, _R0),
    ),
    (
        "beckmann",
        "Beckmann and Spizzichino 1963 as a microfacet lobe, V-cavity shadowing, Schlick's Fresnel term in V.H",
        f"p0 + p1 * {_SCHLICK_VH} * exp(-({_TAN2}) / (p2 * p2)) / (pi * p2 * p2 * pow(wh.z, 4))"
        f" * {_BECKMANN_G} / (4 * wi.z * wo.z)",
        (_DIFFUSE_VALUE, _SPECULAR, _ALPHA, _R0),
    ),
    (
        "ward",
        "Ward 1992, isotropic",
        f"p0 / pi + p1 * exp(-({_TAN2}) / (p2 * p2)) / (4 * pi * p2 * p2 * sqrt(wi.z * wo.z))",
        (_DIFFUSE, _SPECULAR, _ALPHA),
    ),
    (
        "ashikhmin-shirley",
        "Ashikhmin and Shirley 2000, isotropic, diffuse term of their eq. 5 with R_s = p3",
        "p0 * 28 / (23 * pi) * (1 - p3) * (1 - pow(1 - wi.z / 2, 5)) * (1 - pow(1 - wo.z / 2, 5))"
        f" + p1 * (p2 + 1) / (8 * pi) * pow(wh.z, p2) / (dot(wo, wh) * max(wi.z, wo.z)) * {_SCHLICK_VH}",
        (_DIFFUSE, _SPECULAR, Parameter("exponent", 0.1, 1e6), Parameter(_R0.meaning, 0.01, 0.999)),
    ),
    (
        "oren-nayar",
        "Oren and Nayar 1994, the qualitative model; sin alpha tan beta cos(phi_i - phi_o) = "
        "(w_i.w_o - NL NV) / max(NL, NV)",
        "p0 / pi * (1 - p1 * p1 / (2 * (p1 * p1 + 0.33))"
        f" + 0.45 * p1 * p1 / (p1 * p1 + 0.09) * max(0, {_OREN_NAYAR_PHI} / max(wi.z, wo.z)))",
        (_DIFFUSE, Parameter("standard deviation of the slope angle, radians", 1e-3, 2.0)),
    ),
    (
        "genbrdf-metal",
        "genBRDF paper, eq. 6",
        "p0 / pi + p1 * exp(-acos(wh.z) / p3)"
        " * min(p2 / p0 * dot(wo, wh), 4 * p3 / (tan(acos(wh.z)) * wo.z * wi.z))"
        " * (p2 + pow(1 - dot(wo, wh), 5))",
        (
            _DIFFUSE,
            _SPECULAR,
            Parameter("alpha: Fresnel floor and shadowing", 1e-6, 1e3),
            Parameter("beta: roughness", 1e-4, 10.0),
        ),
    ),
    (
        "genbrdf-dielectric",
        "genBRDF paper, eq. 7",
        "p0 * (1 + pow(wh.z, 1 - p2))"
        " + min(1 / sqrt(p0), (p2 + (1 - p2) * pow(1 - wh.z, 5))"
        " * (1 / (p3 * p3 * pow(wh.z, 4)) * exp(-pow(tan(acos(wh.z)) / p3, 2)))"
        " / (pi * dot(wo, wh) * wi.z * wo.z))"
        " * (exp(-tan(acos(wh.z)) / p1) / (p2 * p2 * (p2 + 2) * p3))",
        (
            _DIFFUSE_VALUE,
            Parameter("specular falloff k'_s", 1e-5, 1e3),
            Parameter("alpha: Fresnel and normalisation", 1e-5, 1e3),
            Parameter("beta: roughness", 1e-4, 1e3),
        ),
    ),
]

CATALOGUE = {name: Formula(name, source, parse(text), parameters) for name, source, text, parameters in _ENTRIES}


def formula(name: str) -> Formula:
    """The catalogue's formula of that name. Raises `FittersError` with the nearest name."""
    if name not in CATALOGUE:
        near = difflib.get_close_matches(name, CATALOGUE, 1)
        hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(CATALOGUE)}"
        raise FittersError(f"no formula {name!r} in the catalogue: {hint}")
    return CATALOGUE[name]
