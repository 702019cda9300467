"""The search as a chart of the front's best error against time: PNG and SVG, HTML to explore, CSV."""

import csv
from collections.abc import Sequence
from dataclasses import astuple
from itertools import cycle
from pathlib import Path
from statistics import median

import plotly.graph_objects as plotly

from gpsearch.errors import GpsearchError
from gpsearch.pictures.labels import Label, name_beside
from gpsearch.pictures.search_curves import Curve, SearchedRun, curves
from gpsearch.pictures.theme import FOUND_COLOUR, TEXT_COLOUR, new_figure, save, style

COLOURS = (
    *(
        "#c4572b",
        "#3b8a4e",
        "#7b6a9a",
        "#b8902a",
        "#2a9d9d",
        "#b0447c",
        "#6b6b6b",
        "#8c5a3c",
        "#88b04b",
        "#5a7fd6",
    ),
    "#d98cb3",
)
"""Of the searches after the first, which has the front's own."""

COLUMNS = ("run", "name", "seed", "seconds", "error", "nodes", "hypervolume", "members")
GAP_POINTS = 14
"""From the axes to the names."""
HOVER = (
    "%{x:.1f} s: error %{y:.4f} at %{customdata[0]} nodes<br>front of %{customdata[1]}, hypervolume"
    " %{customdata[2]:.3f}<br>seed %{customdata[3]}"
)
TIME, ERROR = "seconds of search", "best error on the front"


def search_chart(runs: Sequence[SearchedRun], folder: Path) -> dict[str, Path]:
    """Writes search.png, .svg, .html and .csv of runs, not empty, into a folder; their paths by format.

    Runs of one name are repetitions of one search: thin lines, and their median thick. Raises `GpsearchError` for
    runs that cannot be compared, or where the folder cannot be written.
    """
    drawn = curves(runs)
    title = _title(runs[0], drawn)
    files = {form: folder / f"search.{form}" for form in ("png", "svg", "html", "csv")}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _draw(drawn, title, files)
        files["html"].write_text(_html(drawn, title))
        _write_csv(drawn, files["csv"])
    except OSError as error:
        raise GpsearchError(f"{folder}: cannot be written ({error.strerror}); choose another -o") from None
    return files


def grouped(drawn: Sequence[Curve]) -> dict[str, list[Curve]]:
    """Curves by name, in their order."""
    groups: dict[str, list[Curve]] = {}
    for curve in drawn:
        groups.setdefault(curve.name, []).append(curve)
    return groups


def points(curve: Curve) -> tuple[list[float], list[float]]:
    """Seconds and errors of a curve's corners, with its end."""
    errors = [step.error for step in curve.steps]
    return [*(step.seconds for step in curve.steps), curve.seconds], [*errors, errors[-1]]


def median_points(repetitions: Sequence[Curve]) -> tuple[list[float], list[float]]:
    """Corners of the median of curves, from when all have a front to when the first of them ends."""
    begin = max(curve.steps[0].seconds for curve in repetitions)
    end = min(curve.seconds for curve in repetitions)
    corners = {step.seconds for curve in repetitions for step in curve.steps if begin <= step.seconds < end}
    seconds = [*sorted(corners | {begin}), max(begin, end)]
    reached = [[step.error for curve in repetitions if (step := curve.at(time))] for time in seconds]
    return seconds, [median(errors) for errors in reached]


def _title(first: SearchedRun, drawn: Sequence[Curve]) -> str:
    materials = len(first.configuration.material_names)
    searches, count = len(grouped(drawn)), len(drawn)
    return (
        f"{materials} material{'s' * (materials > 1)}, {searches} search{'es' * (searches > 1)},"
        f" {count} run{'s' * (count > 1)}, {first.configuration.metric} metric"
    )


def _coloured(drawn: Sequence[Curve]) -> list[tuple[str, str, list[Curve]]]:
    """(name, colour, curves) of every search."""
    groups = grouped(drawn)
    colours = [FOUND_COLOUR, *(colour for colour, _ in zip(cycle(COLOURS), groups, strict=False))]
    return [(name, colour, runs) for (name, runs), colour in zip(groups.items(), colours, strict=False)]


def _draw(drawn: Sequence[Curve], title: str, files: dict[str, Path]) -> None:
    figure = new_figure(8, 5)
    axes = figure.add_subplot()
    ends = []
    for order, (name, colour, runs) in enumerate(_coloured(drawn)):
        seconds, errors = median_points(runs)
        above = len(drawn) - order
        axes.step(
            seconds,
            errors,
            where="post",
            color=colour,
            lw=2.2 if order == 0 else 1.4,
            zorder=2 + above,
            label=name,
        )
        ends.append((name, colour, (seconds[-1], errors[-1])))
        for curve in runs if len(runs) > 1 else ():
            axes.step(*points(curve), where="post", color=colour, lw=0.6, alpha=0.35, zorder=1)
    axes.set_xscale("log")
    axes.set_yscale("log")
    style(axes, plain_numbers="xy")
    axes.set_xlabel(TIME)
    axes.set_ylabel(ERROR)
    axes.set_title(title, fontsize=10, color=TEXT_COLOUR)
    # Where names can stand is known once the figure is drawn; they make the axes narrower, but no lower.
    figure.canvas.draw()
    at = axes.transData.transform([end for *_, end in ends])
    labels = [Label(name, x, y, colour) for (name, colour, _), (x, y) in zip(ends, at, strict=True)]
    name_beside(axes, labels, gap=GAP_POINTS)
    save(figure, [files["png"], files["svg"]])


def _html(drawn: Sequence[Curve], title: str) -> str:
    """A page that needs no network: the chart, and under the pointer what the front was then."""
    figure = plotly.Figure()
    for name, colour, runs in _coloured(drawn):
        for i, curve in enumerate(runs):
            seconds, errors = points(curve)
            steps = [*curve.steps, curve.steps[-1]]
            figure.add_trace(
                plotly.Scatter(
                    x=seconds,
                    y=errors,
                    name=name,
                    legendgroup=name,
                    showlegend=i == 0,
                    mode="lines+markers",
                    line={"shape": "hv", "color": colour, "width": 2},
                    marker={"size": 4},
                    customdata=[(s.nodes, s.members, s.hypervolume, curve.seed) for s in steps],
                    hovertemplate=HOVER,
                )
            )
    figure.update_layout(title=title, template="simple_white", hovermode="closest")
    figure.update_xaxes(type="log", title=TIME, showgrid=True)
    figure.update_yaxes(type="log", title=ERROR, showgrid=True)
    return figure.to_html(include_plotlyjs=True, div_id="search")


def _write_csv(drawn: Sequence[Curve], path: Path) -> None:
    """A row per corner of every curve, and one for its end."""
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for curve in drawn:
            run = (str(curve.run), curve.name, curve.seed)
            writer.writerows((*run, *astuple(step)) for step in curve.steps)
            writer.writerow((*run, curve.seconds, *astuple(curve.steps[-1])[1:]))
