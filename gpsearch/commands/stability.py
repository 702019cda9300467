"""`gpsearch stability`: every method of fitting on everything that is known to make fits fail."""

import json
import math
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from fitters.models import MODELS, warm_up
from fitters.stability import (
    HAZARDS,
    METHODS,
    Cell,
    Outcome,
    Trial,
    cells_of,
    failed,
    level_names,
    run_trial,
    skipped,
    trials_of,
)
from fitters.stability.trial import base_of
from fitters.stability.verdict import LEAST, PARAMETER, SPREAD, TIMES
from gpsearch import __version__
from gpsearch.commands.progress import duration
from gpsearch.commands.runs import json_option, print_json, write_text
from gpsearch.pictures.stability_plot import plot_stability
from workers import DaskSettings, Failure, Job, LocalSettings, Recipe, open_executor

SCHEMA = "gpsearch-stability/1"
FEW = 16
"""Up to this number of trials run in this process: starting other processes takes seconds."""


class Names(click.ParamType):
    """A list of known names, separated by commas."""

    name = "name,.."

    def __init__(self, known: Sequence[str]) -> None:
        self.known = tuple(known)

    def convert(self, value: Any, param: click.Parameter | None, context: click.Context | None) -> tuple[str, ...]:
        if isinstance(value, tuple):
            return value
        names = tuple(dict.fromkeys(filter(None, map(str.strip, value.split(",")))))
        unknown = [name for name in names if name not in self.known]
        if unknown or not names:
            self.fail(f"{', '.join(unknown) or 'nothing'} is not among {', '.join(self.known)}", param, context)
        return names


def _listing() -> str:
    methods = "\n".join(f"  {method.name:18s} {method.meaning}" for method in METHODS.values())
    hazards = "\n".join(
        f"  {hazard.name:18s} {', '.join(hazard.levels)}\n{'':21s}{hazard.meaning}" for hazard in HAZARDS.values()
    )
    return f"\b\nMethods:\n{methods}\n\n\b\nHazards and their levels:\n{hazards}"


HELP = f"""Tries every method of fitting on what is known to make fits fail, where the truth is known.

Writes stability.json, stability.png and stability.svg into the folder of -o, and prints a line for each method and
hazard where it fails. A fit fails if its error against the truth (light or compressive metric, all lit cells) is
above {TIMES:g} times that of the same method on the undisturbed material, and above {LEAST:g}; if a known
parameter is wrong by more than {PARAMETER:.0%}; if its restarts end over {SPREAD:.0%} apart; or if it raises an
error.

{_listing()}
"""


@click.command(help=HELP)
@click.option("--methods", type=Names(list(METHODS)), default=tuple(METHODS), show_default="all")
@click.option("--hazards", type=Names(list(HAZARDS)), default=tuple(HAZARDS), show_default="all")
@click.option("--seeds", type=click.IntRange(1, 100), default=2, show_default=True, help="Of noise and starts.")
@click.option("--material", help="A measurement to disturb, taken for true, instead of the built-in GGX metal.")
@click.option(
    "-o", "folder", type=click.Path(path_type=Path, file_okay=False), default=Path("stability"), show_default=True
)
@json_option
def stability(
    methods: tuple[str, ...],
    hazards: tuple[str, ...],
    seeds: int,
    material: str | None,
    folder: Path,
    as_json: bool,
) -> None:
    console = Console(stderr=True, soft_wrap=True, markup=False, emoji=False, highlight=False)
    # A material that cannot be read is refused here, not in every trial.
    base = base_of(material)
    _make(folder)
    trials = trials_of(methods, hazards, seeds, material is not None)
    began = time.monotonic()
    outcomes = _run(trials, material, console)
    cells = cells_of(outcomes, level_names())
    report = {
        "schema": SCHEMA,
        "version": __version__,
        "material": base.material.name,
        "seeds": seeds,
        "seconds": round(time.monotonic() - began, 1),
        "trials": len(trials),
        "criteria": {"times": TIMES, "least": LEAST, "parameter": PARAMETER, "spread": SPREAD},
        "skipped": skipped(methods, hazards, seeds, material is not None),
        "methods": {name: METHODS[name].meaning for name in methods},
        "hazards": {name: HAZARDS[name].meaning for name in hazards},
        "cells": [_entry(cell) for cell in cells],
        "lines": [cell.line for cell in cells if cell.line],
    }
    write_text(folder / "stability.json", json.dumps(report, indent=1, allow_nan=False) + "\n")
    plot_stability(cells, [folder / "stability.png", folder / "stability.svg"])
    if as_json:
        print_json(report)
        return
    _print(report, cells, folder)


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise click.ClickException(f"{folder}: cannot be made ({error.strerror}); choose another -o") from None


def _run(trials: Sequence[Trial], material: str | None, console: Console) -> list[Outcome]:
    """Outcomes in the order of the trials: in this process, or in one for each core where there are many."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    here = cores == 1 or len(trials) <= FEW
    reference = _absolute(material)
    job = Job(_trial, Recipe(_reference, reference), trials, "trial", 2.0)
    results: dict[int, Any] = {}
    if not here:
        # Processes that begin to fit at the same time would all compile the same functions.
        warm_up({trial.method for trial in trials} & set(MODELS))
    with (
        _progress(console) as progress,
        open_executor(LocalSettings() if here else DaskSettings(workers=cores)) as executor,
    ):
        task = progress.add_task(f"{len(trials)} trials", total=len(trials))
        executor.submit(job)
        while len(results) < len(trials):
            for done in executor.wait(0.25):
                results[done.index] = done.result
                progress.advance(task)
    return [
        failed(trial, results[i].reason) if isinstance(results[i], Failure) else results[i]
        for i, trial in enumerate(trials)
    ]


def _reference(reference: str | None) -> str | None:
    """The context of a trial; the trial's own caches hold the heavy data."""
    return reference


def _trial(reference: str | None, trial: Trial) -> Outcome:
    return run_trial(reference, trial)


def _absolute(material: str | None) -> str | None:
    """A reference that has the same meaning in any process."""
    return material if material is None or ":" in material else str(Path(material).absolute())


def _progress(console: Console) -> Progress:
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(bar_width=24),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )


def _entry(cell: Cell) -> dict[str, Any]:
    """A cell as JSON, which has no infinity."""
    return {name: _plain(value) for name, value in asdict(cell).items()}


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {name: _plain(part) for name, part in value.items()}
    return [_plain(part) for part in value] if isinstance(value, list | tuple) else value


def _print(report: dict[str, Any], cells: Sequence[Cell], folder: Path) -> None:
    failing = [cell for cell in cells if cell.line]
    silent = sum(cell.silent for cell in failing)
    for line in report["lines"]:
        click.echo(line)
    for said in report["skipped"]:
        click.echo(f"not tried: {said}")
    click.echo(
        f"{len(failing)} of {len(cells)} cells fail, {silent} of them silently; {report['trials']} trials in "
        f"{duration(report['seconds'])}. {folder / 'stability.png'} shows them."
    )
