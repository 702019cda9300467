"""How all pictures look: colours, axes, files."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fitters.models import FAMILIES
from gpsearch.run.result import FOUND, PUBLISHED

TEXT_COLOUR, QUIET_COLOUR, MARK_COLOUR = "#333333", "#999999", "#111111"
PICK_COLOUR = "#c0392b"
DASHES = (0, (5, 3))


class Kind(NamedTuple):
    """How a kind of model is drawn and named."""

    label: str
    colour: str


KINDS = {
    FOUND: Kind("found by the search", "#1f5fa8"),
    **{name: Kind(family.label, family.colour) for name, family in FAMILIES.items()},
}
"""By the kind of an entry: formulas that were found, and the families of the other models."""
FOUND_COLOUR, PUBLISHED_COLOUR = KINDS[FOUND].colour, KINDS[PUBLISHED].colour
TABLE_COLOUR = KINDS["factors"].colour
"""Of all that is no formula, where kinds of tables are not distinguished."""


def new_figure(width: float, height: float, *, dpi: float = 150, layout: str | None = "constrained") -> Figure:
    """A figure of some inches, with a canvas: `figure.canvas.draw()` says where everything is."""
    figure = Figure(figsize=(width, height), dpi=dpi, layout=layout)  # type: ignore[arg-type]
    FigureCanvasAgg(figure)
    return figure


def style(axes: Axes, *, plain_numbers: str = "") -> None:
    """Ticks and grid of a plot; `plain_numbers` ("xy") are the axes whose ticks are written without powers."""
    axes.tick_params(which="both", labelsize=8, colors=TEXT_COLOUR)
    axes.grid(True, which="major", lw=0.4, alpha=0.5)
    for name in plain_numbers:
        getattr(axes, f"{name}axis").set_major_formatter("{x:g}")
    if "y" in plain_numbers:
        axes.yaxis.set_minor_formatter("{x:g}")


def save(figure: Figure, paths: Sequence[Path]) -> None:
    """Writes a figure as the image formats that the suffixes name; the same figure gives the same files."""
    with mpl.rc_context({"svg.hashsalt": "gpsearch"}):
        for path in paths:
            figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None)
