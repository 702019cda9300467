"""`gpsearch status RUN`: where a run stands."""

from contextlib import closing
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Any

import click

from gpsearch.commands.progress import duration, seconds_left, work
from gpsearch.commands.runs import json_option, print_json, run_argument
from gpsearch.configuration import Configuration
from gpsearch.run import Store, open_run
from gpsearch.run.lock import holder
from gpsearch.search.plan import budget_of

LAST_EVENTS = 5
QUARANTINED = 5
"""Lines that are shown of either; the JSON has all of the quarantine, and as many events."""


@click.command()
@run_argument
@json_option
def status(run: Path, as_json: bool) -> None:
    """Says where RUN stands, while it runs or after."""
    store, configuration = open_run(run)
    with closing(store):
        report = _report(run, store, configuration)
    if as_json:
        print_json(report)
    else:
        _print(report)


def _report(run: Path, store: Store, configuration: Configuration) -> dict[str, Any]:
    generations, candidates, fitted = store.totals()
    members, seconds, events = store.front().members, store.seconds, store.events()
    runs_at, budget = holder(run), configuration.budget
    left = seconds_left(budget_of(configuration), generations, candidates, seconds)
    return {
        "name": configuration.name,
        "running": None if runs_at is None else {"host": runs_at.host, "pid": runs_at.pid},
        "generations": generations,
        "of_generations": budget.generations,
        "islands": [{"island": n, "generation": reached} for n, reached in store.island_generations().items()],
        "candidates": candidates,
        "of_candidates": budget.candidates,
        "fitted": fitted,
        "given_up": sum(generation.given_up for generation in store.generations()),
        "seconds": round(seconds, 1),
        "of_seconds": None if budget.minutes is None else 60.0 * budget.minutes,
        "candidates_per_second": round(candidates / seconds, 2) if seconds else None,
        "seconds_left": None if left is None else round(left, 1),
        "front": len(members),
        "best": {"nodes": members[-1].nodes, "error": members[-1].error} if members else None,
        "workers": _workers(events),
        "lost_workers": sum(kind == "lost" for _, kind, _ in events),
        "retries": sum(int(detail) for _, kind, detail in events if kind == "retry"),
        "quarantined": [asdict(candidate) for candidate in store.quarantined()],
        "events": [
            {"time": _clock(when), "kind": kind, "detail": detail}
            for when, kind, detail in [event for event in events if event[1] != "retry"][-LAST_EVENTS:]
        ],
    }


def _workers(events: list[tuple[float, str, str]]) -> str | None:
    """What was heard last of the workers of the latest launch."""
    for _, kind, detail in reversed(events):
        if kind == "workers":
            return detail
        if kind == "launch":
            return detail.partition(" on ")[2]
    return None


def _clock(seconds: float) -> str:
    return datetime.fromtimestamp(seconds).astimezone().isoformat(timespec="seconds")


def _print(report: dict[str, Any]) -> None:
    total = f" of {report['of_generations']}" if report["of_generations"] else ""
    rate, left = report["candidates_per_second"], report["seconds_left"]
    running = report["running"]
    state = f"running (process {running['pid']} on {running['host']})" if running else "not running"
    click.echo(f"{report['name']}: {state}")
    click.echo(
        f"generation {report['generations']}{total}, {report['candidates']:,} candidates,"
        f" {duration(report['seconds'])}"
        + (f", {rate:.0f} a second" if rate else "")
        + (f", {duration(left)} left" if left is not None else "")
    )
    if report["islands"]:
        reached = "  ".join(f"{one['island']}: {one['generation']}" for one in report["islands"])
        click.echo(f"generations of islands: {reached}")
    if report["candidates"]:
        click.echo(f"fits: {work(report['candidates'], report['fitted'], report['given_up'])}")
    if best := report["best"]:
        click.echo(f"front: {report['front']} formulas, the best {best['error']:.4f} at {best['nodes']} nodes")
    if report["workers"]:
        click.echo(f"workers: {report['workers']}")
    click.echo(
        f"{report['retries']} retries, {report['lost_workers']} workers lost,"
        f" {len(report['quarantined'])} quarantined"
    )
    for candidate in report["quarantined"][-QUARANTINED:]:
        click.echo(f"  {candidate['stage']}: {candidate['expression']}: {candidate['reason']}")
    for event in report["events"]:
        click.echo(f"{event['time']}  {event['kind']}: {event['detail']}")
