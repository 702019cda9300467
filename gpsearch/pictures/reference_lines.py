"""Reference fits that have no size, in the plot of error against size: lines across it, named beside it."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from scipy.optimize import isotonic_regression

COLOUR = "#7b6a9a"
FONT_POINTS = 7
SPACING_POINTS = 1.3 * FONT_POINTS
"""Between the middles of two names."""
GAP_POINTS = 12
"""From the axes to the names."""
BEYOND = 2.0
"""A reference so many times worse than all that has a size is named at the edge, not drawn to scale."""


class ReferenceLines:
    """The lines of some baselines (name, error) in axes; `sized` are the errors of what has a size there."""

    def __init__(
        self, axes: Axes, baselines: Sequence[tuple[str, float]], sized: Sequence[float], dpi: float
    ) -> None:
        self._axes, self._dpi = axes, dpi
        self._baselines = sorted(baselines, key=lambda b: (b[1], b[0]))
        self._highest = BEYOND * max(sized, default=np.inf)
        label = "tabulated references"
        for baseline in self._baselines:
            if not self._is_beyond(baseline):
                axes.axhline(baseline[1], color=COLOUR, lw=0.8, ls=(0, (5, 3)), zorder=1, label=label)
                label = "_"  # one entry in the legend stands for all

    def name(self) -> None:
        """Names the lines at their right ends, apart from each other; the figure must have been drawn."""
        if not self._baselines:
            return
        box = self._axes.get_window_extent()
        points = 72 / self._dpi
        ends = [self._end(baseline, box.y1) for baseline in self._baselines]
        places = spread(np.array(ends) * points, SPACING_POINTS, box.y0 * points, box.y1 * points)
        for baseline, end, place in zip(self._baselines, ends, places, strict=True):
            beyond = self._is_beyond(baseline)
            self._axes.annotate(
                f"{baseline[0]} ({baseline[1]:.2g} \N{UPWARDS ARROW})" if beyond else baseline[0],
                (1, (end - box.y0) / box.height),
                (GAP_POINTS, place - end * points),
                xycoords="axes fraction",
                textcoords="offset points",
                ha="left",
                va="center",
                fontsize=FONT_POINTS,
                color=COLOUR,
                annotation_clip=False,
                arrowprops=None if beyond else _LEADER,
            )

    def _is_beyond(self, baseline: tuple[str, float]) -> bool:
        return baseline[1] > self._highest

    def _end(self, baseline: tuple[str, float], top: float) -> float:
        """The height of a line in pixels, the axes' upper edge where it is beyond."""
        if self._is_beyond(baseline):
            return top
        return float(self._axes.transData.transform((1, baseline[1]))[1])


_LEADER = {"arrowstyle": "-", "color": COLOUR, "lw": 0.6, "shrinkA": 1, "shrinkB": 0, "relpos": (0, 0.5)}


def spread(wanted: np.ndarray, spacing: float, low: float, high: float) -> np.ndarray:
    """Places (n,) nearest to rising wanted ones that are `spacing` apart and, where they fit, in [low, high]."""
    shifts = spacing * np.arange(len(wanted))
    nearest = isotonic_regression(wanted - shifts).x
    return np.maximum(np.minimum(nearest, high - shifts[-1]), low) + shifts
