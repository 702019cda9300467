"""The front as a plot of error against size."""

from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from gpsearch.pictures.reference_lines import ReferenceLines
from gpsearch.run import Result

FRONT_COLOUR, BASELINE_COLOUR, TEXT_COLOUR = "#1f5fa8", "#c4572b", "#333333"

MARKER = 10
"""Pixels across that a point's marker takes."""

PLACES: tuple[tuple[tuple[int, int], dict[str, Any]], ...] = (
    ((6, 4), {"ha": "left", "va": "bottom"}),
    ((-6, 4), {"ha": "right", "va": "bottom"}),
    ((6, -4), {"ha": "left", "va": "top"}),
    ((-6, -4), {"ha": "right", "va": "top"}),
)
"""Where a name may stand beside its point: offset in points, and the corner of the text that lies there."""


def plot_front(result: Result, path: Path) -> None:
    """Writes the plot of a result as the image format that the suffix names."""
    figure = Figure(figsize=(8, 5), dpi=150, layout="constrained")
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    front, fitted = result.formulas, [b for b in result.baselines if b.error is not None]
    sizes, errors = [formula.nodes for formula in front], [formula.error for formula in front]
    if front:
        last = max(sizes + [b.nodes for b in result.baselines if b.nodes is not None])
        axes.step([*sizes, last * 1.05], [*errors, errors[-1]], where="post", color=FRONT_COLOUR, lw=1, alpha=0.5)
        axes.plot(sizes, errors, "o", color=FRONT_COLOUR, ms=5, label="found by the search")
    drawn = [(b.name, b.nodes, b.error) for b in fitted if b.nodes is not None and b.error is not None]
    if drawn:
        axes.plot(
            [nodes for _, nodes, _ in drawn],
            [error for *_, error in drawn],
            "D",
            color=BASELINE_COLOUR,
            ms=6,
            label="published, refitted",
        )
    tabulated = [(b.name, b.error) for b in fitted if b.nodes is None and b.error is not None]
    lines = ReferenceLines(axes, tabulated, errors + [error for *_, error in drawn], figure.dpi)
    run = result.run
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("{x:g}")
    axes.tick_params(which="both", labelsize=8, colors=TEXT_COLOUR)
    axes.set_xlabel("size of the formula (nodes)")
    axes.set_ylabel(f"error ({run.metric} metric, relative)")
    axes.set_title(
        f"{run.name}: {len(run.materials)} materials, {run.candidates:,} candidates"
        f" in {max(run.seconds / 60, 0.1):.2g} min",
        fontsize=10,
        color=TEXT_COLOUR,
    )
    axes.grid(True, which="major", lw=0.4, alpha=0.5)
    if front or drawn or tabulated:
        axes.legend(frameon=False, fontsize=9)
    # Where names can stand is known once the figure is drawn; those beside the axes make the axes narrower.
    canvas.draw()
    lines.name()
    canvas.draw()
    _name(axes, drawn)
    figure.savefig(path)


def _name(axes: Axes, points: list[tuple[str, int, float]]) -> None:
    """Names points of a drawn figure, each at the first place where it hides no name or point and stays inside."""
    inside = axes.get_window_extent()
    taken = [_marker(axes, x, y) for _, x, y in points]
    for name, x, y in sorted(points, key=lambda point: point[1:]):
        for place, (offset, sides) in enumerate(PLACES):
            text = axes.annotate(
                name, (x, y), offset, textcoords="offset points", fontsize=8, color=BASELINE_COLOUR, **sides
            )
            box = text.get_window_extent()
            if place == len(PLACES) - 1 or (box.x1 < inside.x1 and not any(map(box.overlaps, taken))):
                taken.append(box)
                break
            text.remove()


def _marker(axes: Axes, x: float, y: float) -> Bbox:
    """The box of a point's marker on the drawn figure."""
    across, up = axes.transData.transform((x, y))
    return Bbox.from_bounds(across - MARKER / 2, up - MARKER / 2, MARKER, MARKER)
