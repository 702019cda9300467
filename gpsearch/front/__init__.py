"""The Pareto front of error and size, and the store that keeps it."""

from gpsearch.front.baselines import Baseline, FormulaBaseline, TabulatedBaseline
from gpsearch.front.front import Front, Member, Screened
from gpsearch.front.known import Known
from gpsearch.front.listed import ListedFormula, listed_formulas
from gpsearch.front.store import Generation, Quarantined, Store
from gpsearch.front.transfers import Transfer, combined

__all__ = [
    "Baseline",
    "FormulaBaseline",
    "Front",
    "Generation",
    "Known",
    "ListedFormula",
    "Member",
    "Quarantined",
    "Screened",
    "Store",
    "TabulatedBaseline",
    "Transfer",
    "combined",
    "listed_formulas",
]
