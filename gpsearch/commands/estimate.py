"""What `gpsearch launch --check` prints: the plan, and what it would cost, measured on a few fits."""

import os
import time

import click

from fitters.fitting import Candidate
from fitters.fitting.reduction import reduction
from fitters.materials import load_material
from fitters.scenes import LightTable, light_table
from gpsearch.commands.progress import duration
from gpsearch.configuration import Configuration, DaskExecutorSection
from gpsearch.evolution.island import Island, advance
from gpsearch.search.plan import Plan, problem_recipe

PROBES = 24
"""Founders that are fitted to measure the rate."""


def estimate(configuration: Configuration, planned: Plan) -> None:
    """Loads everything, fits a few founders, and prints the plan with the time it would take."""
    table = light_table(configuration.scene.recipe, base=configuration.folder)
    problem = problem_recipe(configuration).build()
    for reference in configuration.test_materials:
        load_material(reference, base=configuration.folder)
    founders = advance(Island(0), planned.breeding, planned.seed)[:PROBES]
    candidates = [Candidate(founder.canonical.text) for founder in founders]
    # The first fit compiles or loads the engine.
    planned.screen(problem, candidates[0])
    began = time.perf_counter()
    for candidate in candidates:
        planned.screen(problem, candidate)
    rate = len(founders) / (time.perf_counter() - began)
    processes, where = _processes(configuration)
    search, budget = configuration.search, planned.budget
    per_generation = search.islands * search.island_size
    generation_seconds = per_generation / (rate * processes)
    limits = [duration(budget.seconds)] if budget.seconds is not None else []
    if budget.generations is not None:
        limits.append(f"{budget.generations} generations ({duration(generation_seconds * budget.generations)})")
    if budget.candidates is not None:
        limits.append(f"{budget.candidates:,} candidates ({duration(budget.candidates / (rate * processes))})")
    cells = reduction(problem)
    tests = configuration.test_material_names
    bank = len(planned.breeding.mutation.codebank)
    click.echo(
        f"{configuration.name}: the configuration is valid\n"
        f"  materials   {', '.join(problem.names)} ({len(problem.targets)} targets)\n"
        + (f"  tested on   {', '.join(tests)}\n" if tests else "")
        + f"  scene       {configuration.scene.geometry}, {configuration.scene.light}: {cells.lit:,} lit of"
        f" {cells.measured:,} measured cells, 99 % of what is seen in {cells.carrying[0.99]:,};"
        f" {cells.sampled:,} sampled\n"
        f"  light table {table.exactness}\n"
        f"  search      {search.islands} islands of {search.island_size}, {per_generation:,} candidates a"
        f" generation, codebank of {bank}\n"
        f"  executor    {where}\n"
        f"  rate        {rate:.0f} candidates/s and process, {duration(generation_seconds)} a generation\n"
        f"  ends after  {', or '.join(limits)}, whatever comes first"
    )
    if not table.converged:
        click.echo(f"warning: {not_converged(table)}", err=True)


def not_converged(table: LightTable) -> str:
    """What to tell of a light table that is not as exact as it should be."""
    return (
        f"the light table is {table.exactness}: errors of formulas that are nearly level may change places; a "
        "light without small bright spots, or a geometry that shows more of its surface, comes nearer"
    )


def _processes(configuration: Configuration) -> tuple[int, str]:
    executor = configuration.executor
    if not isinstance(executor, DaskExecutorSection):
        return 1, "this process"
    if executor.scheduler is not None:
        return 1, f"{executor.scheduler} (the times are for one worker process)"
    processes = executor.workers or os.cpu_count() or 1
    return processes, f"{processes} worker processes on this machine"
