"""The chart for print: a panel for each cost, the error shared, every name once at the right."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter

from gpsearch.pictures.chart.look import Frame, Spot, digits, edge_remark, title
from gpsearch.pictures.chart.models import AXES, Axis, Chart, Charted
from gpsearch.pictures.labels import FONT_POINTS, Label, name_beside
from gpsearch.pictures.theme import KINDS, MARK_COLOUR, QUIET_COLOUR, TEXT_COLOUR, new_figure, save

WIDTH_INCHES, HEIGHT_INCHES = 13.0, 5.6
SPACING_POINTS = 1.25 * FONT_POINTS
"""Between the middles of two names."""
LEADER_POINTS = 22
"""From the last panel to the names."""
MARKER_POINTS, RING_POINTS, TEST_POINTS = 5.5, 11, 3.2
DPI = 160
MARKERS = {"": "o", "left": "<", "bottom": "v", "top": "^"}
"""By the edge that a model lies beyond."""


def write_pictures(chart: Chart, paths: Sequence[Path]) -> None:
    """Writes the chart, in the image formats that the suffixes name."""
    save(drawn(chart), paths)


def drawn(chart: Chart) -> Figure:
    """The figure of a chart."""
    # Higher where there are more names than fit beside the panels.
    names_inches = len(chart.fitted) * SPACING_POINTS / 72
    height = max(HEIGHT_INCHES, names_inches + 1.7)
    figure = new_figure(WIDTH_INCHES, height, dpi=DPI, layout=None)
    panels = list(figure.subplots(1, len(AXES), sharey=True))
    figure.subplots_adjust(left=0.06, right=0.84, top=1 - 0.55 / height, bottom=1.05 / height, wspace=0.09)
    for axes, axis in zip(panels, AXES, strict=True):
        _draw(axes, axis, chart)
    panels[0].set_ylabel(f"error ({chart.run.metric} metric, relative)", color=TEXT_COLOUR)
    figure.suptitle(title(chart), x=0.06, ha="left", fontsize=11, color=TEXT_COLOUR)
    _legend(figure, chart)
    figure.canvas.draw()
    _name(panels[-1], chart)
    return figure


def _draw(axes: Axes, axis: Axis, chart: Chart) -> None:
    frame = Frame(chart)
    axes.set_yscale("log")
    axes.set_xscale("log")
    axes.set_ylim(frame.bottom, frame.top)
    axes.margins(x=0.08)
    steps = frame.steps(chart, axis.key)
    if steps:
        axes.step(*zip(*steps, strict=True), where="post", color=QUIET_COLOUR, lw=1, zorder=1)
    for model in chart.fitted:
        if model.cost(axis.key) is not None:
            spot = frame.spot(model, axis.key)
            axes.axhline(spot.y, color=KINDS[model.entry.kind].colour, lw=0.4, alpha=0.22, zorder=0)
            _mark_test(axes, spot, frame.test_spot(model, axis.key), KINDS[model.entry.kind].colour)
            _mark(axes, spot, model, filled=axis.key in model.unbeaten)
    if axis.key == "ns":
        axes.axvline(chart.empty.ns, color=QUIET_COLOUR, lw=0.8, ls=(0, (1, 2)))
    axes.set_xlabel(axis.label, color=TEXT_COLOUR, fontsize=9)
    axes.xaxis.set_major_formatter(FuncFormatter(_plain))
    axes.xaxis.set_minor_formatter(_minor(*axes.get_xlim()))
    axes.yaxis.set_major_formatter(FuncFormatter(_plain))
    axes.yaxis.set_minor_formatter(_minor(*axes.get_ylim()))
    axes.tick_params(which="both", labelsize=7.5, colors=TEXT_COLOUR)
    axes.grid(True, which="major", axis="x", lw=0.4, alpha=0.5)
    axes.spines[["top", "right"]].set_visible(False)


def _mark(axes: Axes, spot: Spot, model: Charted, *, filled: bool) -> None:
    colour = KINDS[model.entry.kind].colour

    def mark(marker: str, size: float, face: str, edge: str, width: float) -> None:
        axes.plot(
            [spot.x], [spot.y], marker=marker, ms=size, mfc=face, mec=edge, mew=width,
            ls="none", clip_on=False, zorder=3,
        )  # fmt: skip

    mark(MARKERS[spot.edge], MARKER_POINTS, colour if filled else "white", colour, 1.0)
    if model.unbeaten_together:
        mark("o", RING_POINTS, "none", MARK_COLOUR, 0.8)


def _mark_test(axes: Axes, spot: Spot, test: Spot | None, colour: str) -> None:
    """The error on test materials, joined to the model's own mark."""
    if test is not None:
        axes.plot([spot.x, test.x], [spot.y, test.y], color=colour, lw=0.6, clip_on=False, zorder=2)
        axes.plot(
            [test.x], [test.y], marker=MARKERS[test.edge], ms=TEST_POINTS, mfc="white", mec=colour, mew=0.7,
            ls="none", clip_on=False, zorder=2.5,
        )  # fmt: skip


def _plain(value: float, _: int) -> str:
    """A tick's number: 10, 1,000, 1M."""
    return f"{value / 1e6:g}M" if value >= 1e6 else f"{value:,.0f}" if value >= 1 else f"{value:g}"


def _minor(low: float, high: float) -> FuncFormatter:
    """Numbers between the powers of ten."""
    shown = digits(low, high)
    return FuncFormatter(lambda value, place: _plain(value, place) if f"{value:e}"[0] in shown else "")


def _name(axes: Axes, chart: Chart) -> None:
    """Names at the right of the last panel, each led to the height of its error; the figure must be drawn."""
    frame, key = Frame(chart), AXES[-1].key
    edge, labels = axes.get_window_extent().x1, []
    for model in sorted(chart.fitted, key=lambda model: (model.error or 0.0, model.title)):
        spot = frame.spot(model, key)
        height = axes.transData.transform((1, spot.y))[1]
        text, colour = model.title + edge_remark(model, spot), KINDS[model.entry.kind].colour
        labels.append(Label(text, edge, height, colour, bold=model.unbeaten_together))
    name_beside(axes, labels, gap=LEADER_POINTS, spacing=SPACING_POINTS)


def _legend(figure: Figure, chart: Chart) -> None:
    def entry(label: str, **style: object) -> Line2D:
        return Line2D([], [], ls="none", marker="o", ms=MARKER_POINTS, label=label, **style)  # type: ignore[arg-type]

    there = {model.entry.kind for model in chart.fitted}
    handles = [entry(kind.label, color=kind.colour) for name, kind in KINDS.items() if name in there]
    handles += [
        entry("another model is better in both", mfc="white", mec=TEXT_COLOUR),
        Line2D([], [], color=QUIET_COLOUR, lw=1, label="non-dominated"),
        Line2D(
            [], [], ls="none", marker="o", ms=RING_POINTS - 2, mfc="none", mec=MARK_COLOUR, mew=0.8,
            label="non-dominated in error, ns and floats together",
        ),
        Line2D([], [], color=QUIET_COLOUR, lw=0.8, ls=(0, (1, 2)), label="an empty call"),
    ]  # fmt: skip
    if chart.run.test_materials:
        handles.append(
            Line2D(
                [], [], color=TEXT_COLOUR, lw=0.6, marker="o", ms=TEST_POINTS, mfc="white", mew=0.7,
                label="error on the test materials",
            )
        )  # fmt: skip
    figure.legend(
        handles=handles, loc="lower left", bbox_to_anchor=(0.055, 0.0), ncols=5, frameon=False, fontsize=7.5,
        columnspacing=1.6, handletextpad=0.5,
    )  # fmt: skip
    if chart.unfitted:
        names = ", ".join(model.title for model in chart.unfitted)
        figure.text(0.855, 0.02, f"could not be fitted: {names}", fontsize=7, color=TEXT_COLOUR, wrap=True)
