"""Culling: what a fitted formula can do without, at a stated price in error."""

from fitters.fitting.culling.culling import Culled, CullJob, cull
from fitters.fitting.culling.greedy import Step

__all__ = ["CullJob", "Culled", "Step", "cull"]
