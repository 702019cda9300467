"""Names in a plot, placed so that none hides another. The figure must have been drawn before."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.transforms import Bbox, offset_copy
from scipy.optimize import isotonic_regression

FONT_POINTS = 7
SPACING_POINTS = 1.3 * FONT_POINTS
"""Between the middles of two names that stand beside the axes."""
MARKER_PIXELS = 10
"""Across a point's marker."""

LEADER = {"arrowstyle": "-", "lw": 0.6, "shrinkA": 1, "shrinkB": 0, "relpos": (0, 0.5)}
CORNERS = ((6, 4), (-6, 4), (6, -4), (-6, -4))
"""Where a name may stand beside its point: offsets in points."""


@dataclass(frozen=True)
class Label:
    """A name that stands beside the axes, and what it belongs to: a point (x, y) in pixels of the figure."""

    text: str
    x: float
    y: float
    colour: str
    bold: bool = False
    leader: bool = True


def name_beside(axes: Axes, labels: Sequence[Label], *, gap: float, spacing: float = SPACING_POINTS) -> None:
    """Names at the right of the axes, `gap` points beside them, each with a line that leads to its point.

    Names stand in the order of their points, apart from each other. They may make the axes narrower, but no lower.
    """
    if not labels:
        return
    figure = axes.get_figure(root=True)
    assert figure is not None
    box, pixels = axes.get_window_extent(), figure.dpi / 72
    ordered = sorted(labels, key=lambda label: label.y)
    places = spread(np.array([label.y for label in ordered]), spacing * pixels, box.y0, box.y1)
    beside = offset_copy(axes.transAxes, figure, gap, 0, "points")
    for label, place in zip(ordered, places, strict=True):
        line = {
            "arrowstyle": "-",
            "color": label.colour,
            "lw": 0.6,
            "shrinkA": 1,
            "shrinkB": 0,
            "relpos": (0, 0.5),
        }
        axes.annotate(
            label.text,
            ((label.x - box.x0) / box.width, (label.y - box.y0) / box.height),
            (1, (place - box.y0) / box.height),
            xycoords="axes fraction",
            textcoords=beside,
            ha="left",
            va="center",
            fontsize=FONT_POINTS,
            fontweight="bold" if label.bold else "normal",
            color=label.colour,
            annotation_clip=False,
            arrowprops=line if label.leader else None,
        )


def spread(wanted: np.ndarray, spacing: float, low: float, high: float) -> np.ndarray:
    """Places (n,) nearest to rising wanted ones that are `spacing` apart and, where they fit, in [low, high]."""
    shifts = spacing * np.arange(len(wanted))
    nearest = isotonic_regression(wanted - shifts).x
    return np.maximum(np.minimum(nearest, high - shifts[-1]), low) + shifts


def name_points(axes: Axes, points: Sequence[tuple[str, float, float]], colour: str) -> None:
    """Names points (name, x, y), each at the first corner where it hides no name or point and stays inside."""
    inside = axes.get_window_extent()
    taken = [_marker(axes, x, y) for _, x, y in points]
    for name, x, y in sorted(points, key=lambda point: point[1:]):
        for corner in CORNERS:
            text = axes.annotate(
                name,
                (x, y),
                corner,
                textcoords="offset points",
                fontsize=8,
                color=colour,
                ha="left" if corner[0] > 0 else "right",
                va="bottom" if corner[1] > 0 else "top",
            )
            box = text.get_window_extent()
            if corner == CORNERS[-1] or (box.x1 < inside.x1 and not any(map(box.overlaps, taken))):
                taken.append(box)
                break
            text.remove()


def _marker(axes: Axes, x: float, y: float) -> Bbox:
    """The box of a point's marker on the drawn figure."""
    across, up = axes.transData.transform((x, y))
    return Bbox.from_bounds(across - MARKER_PIXELS / 2, up - MARKER_PIXELS / 2, MARKER_PIXELS, MARKER_PIXELS)
