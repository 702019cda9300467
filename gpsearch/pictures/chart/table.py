"""The numbers of a chart as CSV, a row a model."""

import csv
import io
from pathlib import Path
from typing import Any

from gpsearch.pictures.chart.models import AXES, Chart, Charted


def write_table(chart: Chart, path: Path) -> None:
    """Writes the table; what a model does not have is empty."""
    text = io.StringIO()
    rows = [table_row(model, chart) for model in chart.models]
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows({key: "; ".join(v) if isinstance(v, list) else v for key, v in row.items()} for row in rows)
    path.write_text(text.getvalue())


def table_row(model: Charted, chart: Chart) -> dict[str, Any]:
    """A model of a chart as plain objects, the columns of the table; `test_error` only where there are tests."""
    timing = model.timing
    return {
        "name": model.entry.name,
        "kind": model.entry.kind,
        "expression": model.entry.expression,
        "error": model.error,
        **({"test_error": model.entry.test_error} if chart.run.test_materials else {}),
        "ns": timing and round(timing.ns, 2),
        "ns_low": timing and round(timing.low, 2),
        "ns_high": timing and round(timing.high, 2),
        "ns_coherent": model.coherent and round(model.coherent.ns, 2),
        "fit_seconds": model.fit_seconds and round(model.fit_seconds, 4),
        "nodes": model.entry.nodes,
        "floats": model.entry.floats,
        **{f"non_dominated_{axis.key}": axis.key in model.unbeaten for axis in AXES},
        "non_dominated": model.unbeaten_together,
        "warnings": list(model.entry.warnings),
    }
