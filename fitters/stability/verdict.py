"""From outcomes to verdicts: which cells of methods by hazards fail, how, and whether a user can notice it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from fitters.stability.trial import EXACT, JUDGED, UNDISTURBED, Outcome, Trial, same_warning

TIMES = 3.0
"""A fit fails if its error against the truth is more than `TIMES` times the error of the same method on the
undisturbed material, and above `LEAST`."""
LEAST = 0.05
"""A smaller error is not visible."""
PARAMETER = 0.25
"""A fit fails if the relative error of a known parameter is larger."""
SPREAD = 0.25
"""A fit fails if the relative distance of the ends of its restarts is larger."""

HOW = {
    "crashed": "it crashes",
    "raised": "it refuses",
    "not finite": "its values are not finite",
    "error": "its error is too large",
    "parameter": "it gets a known parameter wrong",
    "spread": "its restarts end apart",
}


@dataclass(frozen=True)
class Verdict:
    """The verdict on one outcome.

    how:     keys of `HOW`; empty for a fit that does not fail
    ratio:   its error, relative to that on the undisturbed material, the larger one of `JUDGED`
    noticed: what a user can notice, in sentences: an exception, a warning of a kind that the undisturbed material
             does not have, and too large an error against the measurement itself, which every report states
    """

    outcome: Outcome
    how: tuple[str, ...]
    ratio: float
    noticed: tuple[str, ...]


@dataclass(frozen=True)
class Cell:
    """A method on a hazard at a level, over seeds.

    rate:       share of trials that fail
    errors:     by metric, the largest
    ratio:      the largest of the verdicts
    seeds:      (largest - smallest) / smallest light error over seeds; None with one seed
    parameters, spread, condition: the largest of the outcomes
    silent:     whether some trial fails and a user cannot notice it
    line:       a sentence; empty where no trial fails
    """

    method: str
    hazard: str
    level: str
    trials: int
    rate: float
    how: tuple[str, ...]
    noticed: tuple[str, ...]
    silent: bool
    errors: dict[str, float]
    ratio: float
    parameters: float | None
    spread: float | None
    seeds: float | None
    condition: float | None
    flat: tuple[dict[str, float], ...]
    seconds: float
    line: str


def cells_of(outcomes: Sequence[Outcome], levels: dict[tuple[str, int], str]) -> list[Cell]:
    """One cell per method, hazard and level, in the order of the outcomes.

    `levels` are the names of (hazard, level). Every method needs an outcome on the undisturbed material.
    """
    healthy: dict[str, Outcome] = {}
    for outcome in outcomes:
        if outcome.trial.hazard == UNDISTURBED:
            healthy.setdefault(outcome.trial.method, outcome)
    groups: dict[tuple[str, str, int], list[Verdict]] = {}
    for outcome in outcomes:
        trial = outcome.trial
        verdict = judged(outcome, healthy[trial.method])
        groups.setdefault((trial.method, trial.hazard, trial.level), []).append(verdict)
    return [_cell(verdicts, levels.get(key[1:], "")) for key, verdicts in groups.items()]


def judged(outcome: Outcome, healthy: Outcome) -> Verdict:
    """The verdict on an outcome; `healthy` is that of the same method on the undisturbed material."""
    before = {same_warning(sentence) for sentence in healthy.warnings}
    if outcome.trial.hazard == UNDISTURBED:
        before = set()
    noticed = [sentence for sentence in outcome.warnings if same_warning(sentence) not in before]
    noticed += [
        f"its own {name} error is {outcome.shown[name]:.2g}"
        for name in JUDGED
        if name in outcome.shown and too_large(outcome.shown[name], healthy.shown[name])
    ]
    ratio = max(outcome.errors[name] / max(healthy.errors[name], EXACT) for name in JUDGED)
    return Verdict(outcome, _how(outcome, healthy), ratio, (outcome.raised,) if outcome.raised else tuple(noticed))


def too_large(error: float, healthy: float) -> bool:
    """Whether an error makes a fit fail; `healthy` is the error on the undisturbed material."""
    return error > max(TIMES * healthy, LEAST)


def _how(outcome: Outcome, healthy: Outcome) -> tuple[str, ...]:
    if outcome.raised:
        return ("crashed" if outcome.crashed else "raised",)
    reasons = []
    if any(math.isinf(error) for error in outcome.errors.values()):
        reasons.append("not finite")
    elif any(too_large(outcome.errors[name], healthy.errors[name]) for name in JUDGED):
        reasons.append("error")
    if outcome.parameters is not None and outcome.parameters > PARAMETER:
        reasons.append("parameter")
    if outcome.spread is not None and outcome.spread > SPREAD:
        reasons.append("spread")
    return tuple(reasons)


def _cell(verdicts: Sequence[Verdict], level: str) -> Cell:
    trial = verdicts[0].outcome.trial
    outcomes = [verdict.outcome for verdict in verdicts]
    failing = [verdict for verdict in verdicts if verdict.how]
    how = tuple(name for name in HOW if any(name in verdict.how for verdict in failing))
    errors = [outcome.errors["light"] for outcome in outcomes]
    finite = all(map(math.isfinite, errors))
    conditions = [outcome.condition for outcome in outcomes if outcome.condition is not None]
    spreads = [outcome.spread for outcome in outcomes if outcome.spread is not None]
    parameters = [outcome.parameters for outcome in outcomes if outcome.parameters is not None]
    cell = Cell(
        method=trial.method,
        hazard=trial.hazard,
        level=level,
        trials=len(verdicts),
        rate=len(failing) / len(verdicts),
        how=how,
        noticed=tuple(dict.fromkeys(said for verdict in failing for said in verdict.noticed)),
        silent=any(not verdict.noticed for verdict in failing),
        errors={name: max(outcome.errors[name] for outcome in outcomes) for name in JUDGED},
        ratio=max(verdict.ratio for verdict in verdicts),
        parameters=max(parameters, default=None),
        spread=max(spreads, default=None),
        seeds=max(errors) / max(min(errors), 1e-12) - 1 if len(errors) > 1 and finite else None,
        condition=max(conditions, default=None),
        flat=tuple(dict(flat) for flat in outcomes[0].flat),
        seconds=sum(outcome.seconds for outcome in outcomes) / len(outcomes),
        line="",
    )
    return cell if not failing else _with_line(cell, trial)


def _with_line(cell: Cell, trial: Trial) -> Cell:
    """The cell with its sentence: what fails, how, and how a user notices it."""
    where = trial.hazard if trial.hazard == UNDISTURBED else f"{trial.hazard} ({cell.level})"
    often = "" if cell.rate == 1 else f" in {cell.rate:.0%} of {cell.trials} trials"
    said = f'; it says: "{_first(cell.noticed)}"' if cell.noticed else ""
    silent = "; nothing tells" if cell.silent and not said else "; but not always" if cell.silent else ""
    how = " and ".join(_words(cell, name) for name in cell.how)
    line = f"{cell.method}, {where}: {how}{often}{said}{silent}."
    return Cell(**{**vars(cell), "line": line})


def _words(cell: Cell, how: str) -> str:
    if how == "error":
        name = max(JUDGED, key=lambda metric: cell.errors[metric])
        return f"its {name} error is {cell.errors[name]:.3g}, {cell.ratio:.3g} times the undisturbed fit's"
    if how == "parameter":
        return f"a known parameter is off by {cell.parameters:.0%}"
    if how == "spread":
        return f"its restarts end up to {cell.spread:.0%} apart"
    return HOW[how]


def _first(noticed: Sequence[str], length: int = 160) -> str:
    sentence = noticed[0]
    return sentence if len(sentence) <= length else f"{sentence[:length].rsplit(' ', 1)[0]} .."
