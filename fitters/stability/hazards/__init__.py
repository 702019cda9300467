"""What is known to make fits fail: each hazard makes, from a seed, a case whose truth is known."""

from fitters.stability.hazards import hard_cases, measurement

HAZARDS = {hazard.name: hazard for family in (measurement, hard_cases) for hazard in family.HAZARDS}

__all__ = ["HAZARDS"]
