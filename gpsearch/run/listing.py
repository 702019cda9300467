"""A result as a table to read: text for terminals, HTML for notebooks."""

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gpsearch.run.result import Baseline, Entry, FoundFormula, Result

ROWS = 12
"""Members of the front that the text lists; the export has all."""
LONGEST = 90
"""Characters of a formula that are shown."""


def result_text(result: "Result") -> str:
    """The largest formulas of the front among the published ones, then the tables.

    Where there are test materials, their error stands beside that on the materials of the search.
    """
    front = result.formulas
    published = [b for b in result.baselines if b.expression and b.error is not None]
    rows = [(f.nodes, f.error, f.expression, _errors(f)) for f in front[-ROWS:]]
    rows += [(b.nodes or 0, b.error or 0.0, f"[{b.name}, refitted]", _errors(b)) for b in published]
    lines = [f"nodes    error  {'   test  ' if result.run.test_materials else ''}formula"]
    lines += [f"{nodes:5d}  {errors}  {_cut(text)}" for nodes, _, text, errors in sorted(rows)]
    lines += _tables([b for b in result.baselines if b.kind != "formula"])
    if len(front) > ROWS:
        lines.append(f"({len(front) - ROWS} smaller ones are in the export)")
    return "\n".join(lines)


def _tables(tables: Sequence["Baseline"]) -> list[str]:
    """By error the reference fits that are no formulas; last those that failed, with the reason."""
    fitted = sorted((b for b in tables if b.error is not None), key=lambda b: b.error or 0.0)
    lines = [f"{'-':>5s}  {_errors(b)}  [{b.name}, {b.floats:,} floats a material]" for b in fitted]
    failed = [b for b in tables if b.error is None]
    return lines + [f"{'-':>5s}  {_errors(b)}  [{b.name}, not fitted: {b.warnings[0]}]" for b in failed]


def _errors(entry: "Entry") -> str:
    """The error, and that on test materials where there are any."""
    errors = [entry.error] + ([entry.test.error] if entry.test else [])
    return "  ".join(f"{'-':>7s}" if error is None else f"{error:7.4f}" for error in errors)


def _cut(text: str) -> str:
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."


def result_html(result: "Result") -> str:
    """All formulas by size, then the baselines, with their errors and times of an evaluation."""
    run = result.run
    tests = bool(run.test_materials)
    heads = ["nodes", f"error ({run.metric})", *(["test error"] if tests else []), "ns", "formula"]

    def row(entry: "FoundFormula | Baseline", text: str) -> str:
        numbers = [str(entry.nodes or ""), _html(entry.error), *([_html(entry.test_error)] if tests else [])]
        cells = [f"<td>{number}</td>" for number in (*numbers, f"{entry.cost_ns:.1f}")]
        return f'<tr>{"".join(cells)}<td style="text-align:left">{text}</td></tr>'

    rows = [row(one, f"<code>{escape(one.expression)}</code>") for one in result.formulas]
    rows.append(
        f'<tr><th colspan="{len(heads)}" style="text-align:left">baselines</th></tr>' if result.baselines else ""
    )
    rows += [row(one, escape(one.name)) for one in result.baselines]
    caption = f"{run.name}: {', '.join(run.materials)}; {run.candidates:,} candidates in {run.seconds:.0f} s"
    return (
        f"<table><caption>{escape(caption)}</caption><thead><tr>{''.join(f'<th>{escape(h)}</th>' for h in heads)}"
        f"</tr></thead><tbody>{''.join(rows)}</tbody></table>"
    )


def _html(error: float | None) -> str:
    return "not fitted" if error is None else f"{error:.4f}"
