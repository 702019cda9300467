"""The models of a run as lines: errors beside sizes, and beside each other on training and test materials."""

from collections.abc import Sequence
from typing import Any

import click

SUMMARY_ROWS = 12
"""Members of the front that are listed; the export has all."""

LONGEST = 90
"""Characters of a formula that are shown."""


def list_models(exported: dict[str, Any]) -> None:
    """Prints the largest formulas of an exported front among the published ones, then the tables.

    Where there are test materials, their error stands beside that on the materials of the search.
    """
    front, baselines = exported["front"], exported["baselines"]
    tested = "test_materials" in exported["run"]
    rows = [(m, m["expression"]) for m in front[-SUMMARY_ROWS:]]
    published = [b for b in baselines if b["kind"] == "formula" and b["error"] is not None]
    rows += [(b, f"[{b['name']}, refitted]") for b in published]
    click.echo(f"nodes    error  {'   test  ' if tested else ''}formula")
    for entry, text in sorted(rows, key=lambda row: (row[0]["nodes"], row[0]["error"], row[1])):
        cut = text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."
        click.echo(f"{entry['nodes']:5d}  {_errors(entry)}  {cut}")
    _list_tables([b for b in baselines if b["kind"] != "formula"])
    if len(front) > SUMMARY_ROWS:
        click.echo(f"({len(front) - SUMMARY_ROWS} smaller ones are in the export)")


def _list_tables(tables: Sequence[dict[str, Any]]) -> None:
    """Lists by error the reference fits that are no formulas; last those that failed, with the reason."""
    fitted = [b for b in tables if b["error"] is not None]
    for b in sorted(fitted, key=lambda b: b["error"]):
        click.echo(f"{'-':>5s}  {_errors(b)}  [{b['name']}, {b['floats']:,} floats a material]")
    for b in tables:
        if b["error"] is None:
            click.echo(f"{'-':>5s}  {_errors(b)}  [{b['name']}, not fitted: {b['warnings'][0]}]")


def _errors(entry: dict[str, Any]) -> str:
    """The error of an entry, and that on test materials where there are any."""
    errors = [entry["error"]] + ([entry["test"]["error"]] if "test" in entry else [])
    return "  ".join(f"{'-':>7s}" if error is None else f"{error:7.4f}" for error in errors)
