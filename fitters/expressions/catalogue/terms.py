"""Parameters and terms that several formulas share. A term that names a parameter says so."""

from fitters.expressions.catalogue.published import Parameter

DIFFUSE = Parameter("diffuse albedo", 1e-5, 10.0)
DIFFUSE_VALUE = Parameter("diffuse value, sr^-1", 1e-6, 10.0)
SPECULAR = Parameter("specular scale", 1e-6, 1e6)
R0 = Parameter("reflectance at normal incidence", 0.01, 1.0)
ALPHA = Parameter("roughness", 1e-3, 2.0)

TAN2 = "(1 - wh.z * wh.z) / (wh.z * wh.z)"
SCHLICK_VH = "(p3 + (1 - p3) * pow(1 - dot(wo, wh), 5))"
"""Schlick's Fresnel term in V.H with R0 = p3."""
V_CAVITY = "min(1, min(2 * wh.z * wo.z / dot(wo, wh), 2 * wh.z * wi.z / dot(wo, wh)))"
"""Shadowing and masking of Torrance and Sparrow 1967."""
