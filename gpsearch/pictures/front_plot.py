"""The front as a plot of error against size."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from gpsearch.pictures.labels import Label, name_beside, name_points
from gpsearch.pictures.theme import (
    DASHES,
    FOUND_COLOUR,
    PUBLISHED_COLOUR,
    TABLE_COLOUR,
    TEXT_COLOUR,
    new_figure,
    save,
    style,
)
from gpsearch.run import Result

GAP_POINTS = 12
"""From the axes to the names of references."""
BEYOND = 2.0
"""A reference whose error is larger than all that have a size by this factor is named at the edge, not drawn."""


def plot_front(result: Result, path: Path) -> None:
    """Writes the plot of a result as the image format that the suffix names."""
    figure = new_figure(8, 5)
    axes = figure.add_subplot()
    front, fitted = result.formulas, [b for b in result.baselines if b.error is not None]
    sizes, errors = [formula.nodes for formula in front], [formula.error for formula in front]
    if front:
        last = max(sizes + [b.nodes for b in result.baselines if b.nodes is not None])
        axes.step([*sizes, last * 1.05], [*errors, errors[-1]], where="post", color=FOUND_COLOUR, lw=1, alpha=0.5)
        axes.plot(sizes, errors, "o", color=FOUND_COLOUR, ms=5, label="found by the search")
    published = [(b.name, b.nodes, b.error) for b in fitted if b.nodes is not None and b.error is not None]
    if published:
        _, x, y = zip(*published, strict=True)
        axes.plot(x, y, "D", color=PUBLISHED_COLOUR, ms=6, label="published, refitted")
    # Reference fits that have no size are lines across the plot.
    tables = [(b.name, b.error) for b in fitted if b.nodes is None and b.error is not None]
    limit = BEYOND * max([*errors, *(error for *_, error in published)], default=np.inf)
    _draw_lines(axes, [error for _, error in tables if error <= limit])
    run = result.run
    axes.set_yscale("log")
    style(axes, plain_numbers="y")
    axes.set_xlabel("size of the formula (nodes)")
    axes.set_ylabel(f"error ({run.metric} metric, relative)")
    axes.set_title(
        f"{run.name}: {len(run.materials)} materials, {run.candidates:,} candidates"
        f" in {max(run.seconds / 60, 0.1):.2g} min",
        fontsize=10,
        color=TEXT_COLOUR,
    )
    if front or published or tables:
        axes.legend(frameon=False, fontsize=9)
    # Where names can stand is known once the figure is drawn; those beside the axes make the axes narrower.
    figure.canvas.draw()
    _name_lines(axes, tables, limit)
    figure.canvas.draw()
    name_points(axes, published, PUBLISHED_COLOUR)
    save(figure, [path])


def _draw_lines(axes: Axes, errors: Sequence[float]) -> None:
    label = "tabulated references"
    for error in sorted(errors):
        axes.axhline(error, color=TABLE_COLOUR, lw=0.8, ls=DASHES, zorder=1, label=label)
        label = "_"  # one entry in the legend stands for all


def _name_lines(axes: Axes, tables: Sequence[tuple[str, float]], limit: float) -> None:
    """Names lines at their right ends; what is beyond the limit is named at the upper edge, with its error."""
    box, labels = axes.get_window_extent(), []
    for name, error in sorted(tables, key=lambda table: (table[1], table[0])):
        if error > limit:
            text = f"{name} ({error:.2g} \N{UPWARDS ARROW})"
            labels.append(Label(text, box.x1, box.y1, TABLE_COLOUR, leader=False))
        else:
            labels.append(Label(name, box.x1, axes.transData.transform((1, error))[1], TABLE_COLOUR))
    name_beside(axes, labels, gap=GAP_POINTS)
