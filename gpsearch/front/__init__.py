"""The Pareto front of error and size, and the store that keeps it."""

from gpsearch.front.baselines import Baseline, FormulaBaseline, TabulatedBaseline
from gpsearch.front.front import Front, Member, Screened
from gpsearch.front.known import Known
from gpsearch.front.store import Generation, Quarantined, Store

__all__ = [
    "Baseline",
    "FormulaBaseline",
    "Front",
    "Generation",
    "Known",
    "Member",
    "Quarantined",
    "Screened",
    "Store",
    "TabulatedBaseline",
]
