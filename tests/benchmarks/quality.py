"""How close fits come to the best that is known: errors beside those of fits with much more work."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from fitters.fitting import Fit, FitSettings, Problem, fit_cells
from fitters.grid import Array
from tests.benchmarks.candidates import Candidate, catalogue, random_candidates
from tests.benchmarks.plain import PlainFit
from tests.benchmarks.problem import SEED
from tests.benchmarks.table import Cell, Table

WITHIN = (0.001, 0.01, 0.05)
QUANTILES = (0.5, 0.9, 0.95, 0.99, 1.0)

DEFAULT = FitSettings()
KINDS = {"screening": DEFAULT, "thorough": DEFAULT.thorough()}
"""What a search screens candidates with, and what it fits those with that it keeps."""

WIDE = FitSettings(
    starts=10 * DEFAULT.starts, restarts=10 * DEFAULT.restarts, rounds=8, evaluations=100, tolerance=1e-6
)


@dataclass(frozen=True)
class Extent:
    """random: candidates beside the catalogue's; scipy: starts of SciPy per target of a catalogue formula."""

    random: int = 200
    scipy: int = 4


def tables(problem: Problem, extent: Extent = Extent()) -> Iterator[Table]:
    """One table: a row per kind of candidates and settings."""
    rows, notes = [], []
    for title, candidates, starts in (
        ("catalogue", catalogue(), extent.scipy),
        ("random", random_candidates(extent.random), 0),
    ):
        ratios = _ratios(problem, candidates, starts)
        for kind, of_kind in ratios.items():
            rows.append((f"{title}, {kind}", *_summary(of_kind)))
            notes.append(f"farthest, {title}, {kind}: {_farthest(problem, candidates, of_kind)}")
    yield Table(
        f"Error reached over the best known, per target, {len(problem.sample):,} cells",
        (
            "candidates, settings",
            "targets",
            "no fit",
            *(f"within {100 * share:g} %" for share in WITHIN),
            "median",
            *(f"{100 * quantile:g} %" for quantile in QUANTILES[1:-1]),
            "worst",
        ),
        tuple(rows),
        (
            "best known: by this fit, and by one of ten times as many starts and restarts, on a part of the cells "
            "first and on all; for the catalogue by SciPy as well, Nelder-Mead and then least squares.",
            "Quantiles are of ratio - 1, in per cent, errors in float64. Targets for which nothing finite is "
            "known are left out; no fit: where only more work has found something finite. Those are the far end.",
            *notes,
        ),
    )


def _ratios(problem: Problem, candidates: Iterable[Candidate], starts: int) -> dict[str, Array]:
    """Error over the best known (candidates, targets) for every kind of settings; NaN where no fit is finite."""
    ratios: dict[str, list[Array]] = {kind: [] for kind in KINDS}
    for candidate in candidates:
        errors = {kind: _errors(problem, candidate, settings) for kind, settings in KINDS.items()}
        best = np.minimum.reduce([*errors.values(), _best_known(problem, candidate, starts)])
        for kind in KINDS:
            with np.errstate(invalid="ignore", divide="ignore"):
                ratios[kind].append(errors[kind] / best)
    return {kind: np.array(rows) for kind, rows in ratios.items()}


def _errors(problem: Problem, candidate: Candidate, settings: FitSettings) -> Array:
    found = fit_cells(candidate.expression, problem.sample, problem.metric, candidate.bounds, settings)
    return _judged(problem, candidate, found)


def _judged(problem: Problem, candidate: Candidate, found: Fit) -> Array:
    """Errors (targets,) of a fit in float64: the engine's own may be finite where that is not."""
    plain = (PlainFit(candidate.expression, candidate.bounds, problem.sample, t) for t in range(len(found.errors)))
    return np.array([one.error_with(found.parameters(target)) for target, one in enumerate(plain)])


def _best_known(problem: Problem, candidate: Candidate, starts: int) -> Array:
    """Errors (targets,) that are reached with much more work."""
    on_all = replace(problem.sample, coarse=None)
    near = fit_cells(candidate.expression, problem.sample, problem.metric, candidate.bounds, WIDE)
    wide = fit_cells(candidate.expression, on_all, problem.metric, candidate.bounds, WIDE, near.columns)
    by_scipy = np.full(len(problem.targets), np.inf)
    rng = np.random.default_rng(SEED)
    for target in range(len(problem.targets)):
        plain = PlainFit(candidate.expression, candidate.bounds, problem.sample, target)
        ends = [plain.polish(plain.descend(plain.start(rng))) for _ in range(starts)]
        by_scipy[target] = min((plain.error(end) for end in ends), default=np.inf)
    return np.minimum.reduce([_judged(problem, candidate, near), _judged(problem, candidate, wide), by_scipy])


def _summary(ratios: Array) -> tuple[Cell, ...]:
    """How many targets, the shares of them that are near, and the quantiles of their distance in per cent."""
    known = ratios[~np.isnan(ratios)]
    shares = (f"{100 * np.mean(known <= 1 + share):.1f} %" for share in WITHIN)
    # By rank, since infinite ones cannot be interpolated.
    distances = np.quantile(100 * (known - 1), QUANTILES, method="inverted_cdf")
    unfitted = int(np.sum(np.isinf(known)))
    shown = (float(distance) if np.isfinite(distance) else "no fit" for distance in distances)
    return known.size, unfitted, *shares, *shown


def _farthest(problem: Problem, candidates: Iterable[Candidate], ratios: Array) -> str:
    """The candidate and target with the largest ratio."""
    row, target = np.unravel_index(np.nanargmax(ratios), ratios.shape)
    return f"{list(candidates)[row].name}, {' '.join(problem.targets[target])}"
