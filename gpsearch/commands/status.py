"""`gpsearch status RUN`: where a run stands."""

from pathlib import Path

import click

from gpsearch.commands.progress import duration, work
from gpsearch.commands.runs import json_option, open_run, print_json, run_argument


@click.command()
@run_argument
@json_option
def status(run: Path, as_json: bool) -> None:
    """Says where RUN stands, while it runs or after."""
    store, configuration = open_run(run)
    try:
        generations, candidates, fitted = store.totals()
        given_up = sum(generation.given_up for generation in store.generations())
        members, seconds = store.front().members, store.seconds
        report = {
            "name": configuration.name,
            "generations": generations,
            "of_generations": configuration.budget.generations,
            "candidates": candidates,
            "fitted": fitted,
            "given_up": given_up,
            "seconds": round(seconds, 1),
            "front": len(members),
            "best": {"nodes": members[-1].nodes, "error": members[-1].error} if members else None,
            "last_event": next((f"{kind}: {detail}" for _, kind, detail in reversed(store.events())), None),
        }
    finally:
        store.close()
    if as_json:
        print_json(report)
        return
    total = f" of {report['of_generations']}" if report["of_generations"] else ""
    click.echo(
        f"{configuration.name}: generation {generations}{total}, {candidates:,} candidates,"
        f" {duration(seconds)}" + (f", {candidates / seconds:.0f} a second" if seconds else "")
    )
    if candidates:
        click.echo(f"fits: {work(candidates, fitted, given_up)}")
    if members:
        click.echo(
            f"front: {len(members)} formulas, the best {members[-1].error:.4f} at {members[-1].nodes} nodes"
        )
    click.echo(f"last event: {report['last_event'] or 'none'}")
