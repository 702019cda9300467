"""What an export target is: a function from the result of a run to the files that another program reads."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from gpsearch.run import Formula, Result

Files = Mapping[str, str]
"""Text by the name of its file, in the order in which the files are listed."""


@dataclass(frozen=True)
class Target:
    """A format that `gpsearch export RUN --format NAME` writes.

    name:       the choice of `--format`
    meaning:    what is written, a line for the command's help
    files:      of a result and some of its formulas, those that the user asked for
    per_member: whether each formula has files of its own, or the files are about the whole run
    """

    name: str
    meaning: str
    files: Callable[[Result, Sequence[Formula]], Files]
    per_member: bool = False


def of_run(name: str, meaning: str, file: str, text: Callable[[Result], str]) -> Target:
    """A target that writes one file about a whole run."""
    return Target(name, meaning, lambda result, _: {file: text(result)})


def of_member(name: str, meaning: str, suffix: str, text: Callable[[Result, Formula], str]) -> Target:
    """A target that writes one file for each formula, called by the formula's id and `suffix`."""

    def files(result: Result, formulas: Sequence[Formula]) -> Files:
        return {f"{formula.id}{suffix}": text(result, formula) for formula in formulas}

    return Target(name, meaning, files, per_member=True)
