"""What genetic programming found: Brady et al. 2014, genBRDF."""

from fitters.expressions.catalogue.published import Entry, Parameter
from fitters.expressions.catalogue.terms import DIFFUSE, DIFFUSE_VALUE, SPECULAR

ENTRIES: list[Entry] = [
    (
        "genbrdf-metal",
        2014,
        "Brady et al. 2014, the genBRDF paper, eq. 6",
        "p0 / pi + p1 * exp(-acos(wh.z) / p3)"
        " * min(p2 / p0 * dot(wo, wh), 4 * p3 / (tan(acos(wh.z)) * wo.z * wi.z))"
        " * (p2 + pow(1 - dot(wo, wh), 5))",
        (
            DIFFUSE,
            SPECULAR,
            Parameter("alpha: Fresnel floor and shadowing", 1e-6, 1e3),
            Parameter("beta: roughness", 1e-4, 10.0),
        ),
    ),
    (
        "genbrdf-dielectric",
        2014,
        "Brady et al. 2014, the genBRDF paper, eq. 7",
        "p0 * (1 + pow(wh.z, 1 - p2))"
        " + min(1 / sqrt(p0), (p2 + (1 - p2) * pow(1 - wh.z, 5))"
        " * (1 / (p3 * p3 * pow(wh.z, 4)) * exp(-pow(tan(acos(wh.z)) / p3, 2)))"
        " / (pi * dot(wo, wh) * wi.z * wo.z))"
        " * (exp(-tan(acos(wh.z)) / p1) / (p2 * p2 * (p2 + 2) * p3))",
        (
            DIFFUSE_VALUE,
            Parameter("specular falloff k'_s", 1e-5, 1e3),
            Parameter("alpha: Fresnel and normalisation", 1e-5, 1e3),
            Parameter("beta: roughness", 1e-4, 1e3),
        ),
    ),
]
