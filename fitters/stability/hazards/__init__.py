"""Everything that is known to make fits fail, each as a pure function from a seed to a case with a known truth."""

from fitters.stability.hazards import appearance, corruption, coverage, extremes
from fitters.stability.hazards.hazard import Hazard

HAZARDS = {
    hazard.name: hazard for family in (coverage, appearance, corruption, extremes) for hazard in family.HAZARDS
}

__all__ = ["HAZARDS", "Hazard"]
