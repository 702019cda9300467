"""What to say of results that are not what their names promise."""

import numpy as np

from fitters.grid import Array

MUCH_TAIL = 0.01
UNEXPLAINED = 0.1
"""Share of the reflected light from which on a residual is reported."""


def about_moments(tail_share: float) -> tuple[str, ...]:
    """Of the share of the mean squared slope that lies beyond the last node."""
    if tail_share <= MUCH_TAIL:
        return ()
    return (
        f"{tail_share:.0%} of the mean squared slope lies beyond the last measured elevation (a heavy tail or a "
        "strong Lambertian part): alpha_beckmann is unreliable, alpha_ggx less so.",
    )


def about_fresnel(table: Array) -> tuple[str, ...]:
    """Of a Fresnel table (k, 3) that exceeds 1."""
    above = np.count_nonzero(table.max(axis=1) > 1)
    if not above:
        return ()
    return (
        f"The Fresnel term exceeds 1 at {above} of {len(table)} difference angles, at most {table.max():.3g}: it "
        "is a residual of the microfacet model there, not a Fresnel term.",
    )


def about_residual(residual: float) -> tuple[str, ...]:
    """Of the mean absolute difference of model and measurement, relative."""
    if residual <= UNEXPLAINED:
        return ()
    return (
        f"The model leaves {residual:.0%} of the reflected light unexplained: poor backscattering, a Lambertian "
        "part or several layers are not what it is for. Fit a formula to this material.",
    )
