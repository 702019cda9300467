"""The chart as a page: one file that needs no network, the same panels, with every model's formula."""

import html
import math
import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from gpsearch.pictures.chart.look import Frame, digits, title
from gpsearch.pictures.chart.models import AXES, Chart, Charted
from gpsearch.pictures.theme import KINDS, MARK_COLOUR, QUIET_COLOUR, TEXT_COLOUR

HOVER_COLUMNS = 90
MARKERS = {"": "circle", "left": "triangle-left", "bottom": "triangle-down", "top": "triangle-up"}
STEPS = {"color": QUIET_COLOUR, "width": 1, "shape": "hv"}
RING = {"size": 16, "color": "rgba(0,0,0,0)", "line": {"width": 1.2, "color": MARK_COLOUR}}
TOGETHER_LABEL = "non-dominated in error, ns and floats together"

_PAGE = """\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<title>{title}</title>
<style>
body {{ font: 14px/1.5 system-ui, sans-serif; color: {colour}; margin: 1.2em 1.6em }}
h1 {{ font-size: 1.15em; font-weight: 600; margin: 0 }}
p {{ margin: .3em 0; max-width: 75em; color: #666 }}
#chosen {{ min-height: 5em; margin-top: .5em }}
#chosen code {{ overflow-wrap: anywhere }}
</style>
</head>
<body>
<h1>{title}</h1>
<p>Filled: no other model is better in the error and in this cost. Ringed: none is better in error, ns and floats
together. Hover for a model's numbers; click to follow it through the panels, double-click to let it go; click the
legend to hide a kind. {unfitted}</p>
{figure}
<div id="chosen"></div>
<script>
{script}
</script>
</body>
</html>
"""

_SCRIPT = """\
const graph = document.getElementById("chart"), chosen = document.getElementById("chosen");
function choose(name) {
  const indices = graph.data.map(trace =>
    name === null || !trace.customdata ? null : trace.customdata.flatMap((of, k) => of[0] === name ? [k] : []));
  Plotly.restyle(graph, {selectedpoints: indices});
}
graph.on("plotly_click", event => {
  const [name, about, formula] = event.points[0].customdata;
  choose(name);
  const said = document.createElement("p"), text = document.createElement("code");
  said.textContent = about;
  text.textContent = formula;
  chosen.replaceChildren(said, text);
});
graph.on("plotly_doubleclick", () => { choose(null); chosen.replaceChildren(); });
"""


def write_page(chart: Chart, path: Path) -> None:
    """Writes the page."""
    figure = _figure(chart).to_html(
        full_html=False,
        include_plotlyjs=True,
        div_id="chart",
        config={"displaylogo": False, "responsive": True},
    )
    names = ", ".join(model.title for model in chart.unfitted)
    unfitted = f"Could not be fitted: {names}." if names else ""
    page = _PAGE.format(
        title=html.escape(title(chart)),
        colour=TEXT_COLOUR,
        unfitted=html.escape(unfitted),
        figure=figure,
        script=_SCRIPT,
    )
    path.write_text(page, encoding="utf-8")


def _figure(chart: Chart) -> go.Figure:
    frame = Frame(chart)
    figure = make_subplots(1, len(AXES), shared_yaxes=True, horizontal_spacing=0.015)
    for trace in _legend(chart):
        figure.add_trace(trace, 1, 1)
    for column, axis in enumerate(AXES, 1):
        for trace in _traces(chart, frame, axis.key):
            figure.add_trace(trace, 1, column)
        shown = [frame.spot(model, axis.key).x for model in chart.fitted if model.cost(axis.key) is not None]
        low, high = min([*shown, chart.empty.ns] if axis.key == "ns" else shown), max(shown)
        figure.update_xaxes(
            title_text=axis.label,
            range=[math.log10(low / 1.4), math.log10(high * 1.5)],
            tickvals=_ticks(low / 1.4, high * 1.5),
            row=1,
            col=column,
        )
    figure.update_xaxes(type="log", gridcolor="#e6e6e6", zeroline=False)
    span = [math.log10(frame.bottom / 1.05), math.log10(frame.top * 1.05)]
    figure.update_yaxes(type="log", gridcolor="#e6e6e6", range=span, zeroline=False)
    figure.update_yaxes(tickvals=_ticks(frame.bottom, frame.top))
    figure.update_yaxes(title_text=f"error ({chart.run.metric} metric, relative)", row=1, col=1)
    figure.add_vline(x=chart.empty.ns, line={"color": QUIET_COLOUR, "width": 1, "dash": "dot"}, row=1, col=1)
    figure.update_layout(
        template="plotly_white",
        font={"color": TEXT_COLOUR, "size": 12},
        height=620,
        margin={"l": 60, "r": 20, "t": 20, "b": 50},
        legend={"orientation": "h", "y": -0.12},
        hoverlabel={"align": "left", "bgcolor": "white", "font_size": 12},
        clickmode="event",
    )
    return figure


def _ticks(low: float, high: float) -> list[float]:
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    places = [float(f"{digit}e{decade}") for decade in decades for digit in digits(low, high)]
    return [place for place in places if low <= place <= high]


def _legend(chart: Chart) -> Iterator[go.Scatter]:
    """A trace without points for each kind that there is, and for the marks."""
    there = {model.entry.kind for model in chart.fitted}
    for name, kind in KINDS.items():
        if name in there:
            marker = {"color": kind.colour, "size": 9}
            yield go.Scatter(x=[None], y=[None], mode="markers", name=kind.label, legendgroup=name, marker=marker)
    yield go.Scatter(x=[None], y=[None], mode="markers", name=TOGETHER_LABEL, legendgroup="ring", marker=RING)
    yield go.Scatter(x=[None], y=[None], mode="lines", name="non-dominated", legendgroup="steps", line=STEPS)


def _traces(chart: Chart, frame: Frame, key: str) -> Iterator[go.Scatter]:
    """A panel: the steps of what no other beats, the rings, and a trace for each kind."""
    steps = frame.steps(chart, key)
    x, y = zip(*steps, strict=True) if steps else ((), ())
    yield go.Scatter(x=x, y=y, mode="lines", line=STEPS, hoverinfo="skip", legendgroup="steps", showlegend=False)
    shown = [model for model in chart.fitted if model.cost(key) is not None]
    ringed = [model for model in shown if model.unbeaten_together]
    yield _markers(ringed, frame, key, legendgroup="ring", hoverinfo="skip", marker=RING)
    for name, kind in KINDS.items():
        models = [model for model in shown if model.entry.kind == name]
        marker = {
            "size": 9,
            "opacity": 1,
            "symbol": [MARKERS[frame.spot(model, key).edge] for model in models],
            "color": [kind.colour if key in model.unbeaten else "white" for model in models],
            "line": {"width": 1.5, "color": kind.colour},
        }
        texts = [_hover(model) for model in models]
        yield _markers(models, frame, key, legendgroup=name, hoverinfo="text", hovertext=texts, marker=marker)


def _markers(models: Sequence[Charted], frame: Frame, key: str, **style: Any) -> go.Scatter:
    """Points of models, each with what the page shows of it when it is chosen."""
    spots = [frame.spot(model, key) for model in models]
    return go.Scatter(
        x=[spot.x for spot in spots],
        y=[spot.y for spot in spots],
        mode="markers",
        showlegend=False,
        cliponaxis=False,
        unselected={"marker": {"opacity": 0.12}},
        customdata=[[model.entry.name, _about(model), model.entry.expression or ""] for model in models],
        **style,
    )


def _about(model: Charted) -> str:
    """A model's numbers in a line."""
    parts = [f"{model.title} ({KINDS[model.entry.kind].label})", f"error {model.error:.4g}"]
    if model.entry.test_error is not None:
        parts.append(f"error on test materials {model.entry.test_error:.4g}")
    if model.timing:
        parts.append(f"{model.timing.ns:.3g} ns ({model.timing.low:.3g} to {model.timing.high:.3g})")
    if model.coherent:
        parts.append(f"{model.coherent.ns:.3g} ns coherent")
    if model.fit_seconds is not None:
        parts.append(f"fit {model.fit_seconds:.3g} s")
    if model.entry.nodes is not None:
        parts.append(f"{model.entry.nodes} nodes")
    parts.append(f"{model.entry.floats:,} floats a material")
    return ", ".join(parts)


def _hover(model: Charted) -> str:
    free = [axis.label for axis in AXES if axis.key in model.unbeaten]
    lines = [f"<b>{html.escape(model.title)}</b>", *_about(model).split(", ")[1:]]
    lines.append(f"non-dominated in: {', '.join(free) or 'nothing'}")
    if model.unbeaten_together:
        lines.append("non-dominated in error, ns and floats together")
    if model.entry.expression:
        lines += [html.escape(line) for line in textwrap.wrap(model.entry.expression, HOVER_COLUMNS)]
    lines += [html.escape(line) for said in model.entry.warnings for line in textwrap.wrap(said, HOVER_COLUMNS)]
    return "<br>".join(lines)
