"""What an export target is: a function from the result of a run to the files that another program reads."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from gpsearch.run import Baseline, FoundFormula, Result

Files = Mapping[str, str]
"""Text by the name of its file, in the order in which the files are listed."""


@dataclass(frozen=True)
class Target:
    """A format that `gpsearch export RUN --format NAME` writes.

    name:       the choice of `--format`
    meaning:    what is written, a line for the command's help
    files:      of a result and those of its entries that the user asked for, all formulas or some formulas and
                baselines; raises `GpsearchError` for an entry that the format cannot express
    per_member: whether each entry has files of its own, or the files are about the whole run
    """

    name: str
    meaning: str
    files: Callable[[Result, Sequence[FoundFormula | Baseline]], Files]
    per_member: bool = False


def of_run(name: str, meaning: str, file: str, text: Callable[[Result], str]) -> Target:
    """A target that writes one file about a whole run."""
    return Target(name, meaning, lambda result, _: {file: text(result)})


def of_member(
    name: str, meaning: str, suffix: str, text: Callable[[Result, FoundFormula | Baseline], str]
) -> Target:
    """A target that writes one file for each entry, named by the entry's name and `suffix`."""

    def files(result: Result, entries: Sequence[FoundFormula | Baseline]) -> Files:
        return {f"{entry.name}{suffix}": text(result, entry) for entry in entries}

    return Target(name, meaning, files, per_member=True)
