"""The Pareto front of error and size, and the store that keeps it."""

from fitters.models import Baseline, FormulaBaseline, TabulatedBaseline
from gpsearch.run.front import Front, Member, Screened
from gpsearch.run.known import Known
from gpsearch.run.listed import ListedFormula, listed_formulas
from gpsearch.run.store import Generation, Quarantined, Store
from gpsearch.run.transfers import Transfer, combined

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
