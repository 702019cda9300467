"""The run directory: the store of all that a search needs to go on, its lock, and the result of a run."""

from fitters.models import FormulaBaseline, TabulatedBaseline
from gpsearch.run.front import Front, Known, Member, Screened, non_dominated
from gpsearch.run.loading import listed_expressions, load_run, open_run, result_of
from gpsearch.run.result import Baseline, Entry, FoundFormula, Result, RunInformation
from gpsearch.run.store import Generation, Quarantined, Store
from gpsearch.run.transfers import Transfer, combined
from gpsearch.run.writing import WritableStore

__all__ = [
    "Baseline",
    "Entry",
    "FormulaBaseline",
    "FoundFormula",
    "Front",
    "Generation",
    "Known",
    "Member",
    "Quarantined",
    "Result",
    "RunInformation",
    "Screened",
    "Store",
    "TabulatedBaseline",
    "Transfer",
    "WritableStore",
    "combined",
    "listed_expressions",
    "load_run",
    "non_dominated",
    "open_run",
    "result_of",
]
