"""The stability matrix: methods by hazards, how often each fails, and how far its restarts end apart."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, LogNorm, Normalize

from fitters.stability import Cell
from gpsearch.pictures.theme import TEXT_COLOUR, new_figure, save

NOTHING = "#ececec"
RATES = LinearSegmentedColormap.from_list("rates", ["#f4f8f4", "#f0c27b", "#c0392b"])
SPREADS = LinearSegmentedColormap.from_list("spreads", ["#f4f6fa", "#7fa8d1", "#1b3f73"])
LEAST_SPREAD, MOST_SPREAD = 1e-3, 10.0

LETTERS: Mapping[str, str] = {
    "crashed": "C",
    "raised": "R",
    "not finite": "N",
    "error": "E",
    "parameter": "P",
    "spread": "S",
}
LEGEND = (
    "E error against the truth   P known parameter wrong   S restarts apart   R refuses   N not finite   C crashes"
    "   ! nothing tells"
)


def plot_stability(cells: Sequence[Cell], paths: Sequence[Path]) -> None:
    """Writes the matrix of some cells as the image formats that the paths' suffixes name."""
    rows = list(dict.fromkeys(cell.method for cell in cells))
    columns = list(dict.fromkeys((cell.hazard, cell.level) for cell in cells))
    at = {(cell.method, (cell.hazard, cell.level)): cell for cell in cells}
    figure = new_figure(0.42 * len(columns) + 3.2, 0.5 * len(rows) + 2.6, dpi=100)
    upper, lower = figure.subplots(2, 1, sharex=True)
    rates, spreads = np.full((2, len(rows), len(columns)), np.nan)
    for i, method in enumerate(rows):
        for j, column in enumerate(columns):
            cell = at.get((method, column))
            if cell is None:
                continue
            rates[i, j] = cell.rate
            _write(upper, i, j, _letters(cell), cell.rate > 0.6)
            spread = _widest(cell)
            if spread is not None:
                spreads[i, j] = np.clip(spread, LEAST_SPREAD, MOST_SPREAD)
                _write(lower, i, j, _percent(spread), spread > 0.5)
    _draw(upper, rates, RATES, Normalize(0, 1), rows, columns)
    _draw(lower, spreads, SPREADS, LogNorm(LEAST_SPREAD, MOST_SPREAD), rows, columns)
    upper.tick_params(labelbottom=False)
    upper.set_title(f"failure rate\n{LEGEND}", fontsize=8, loc="left", color=TEXT_COLOUR)
    lower.set_title(
        "spread: (worst - best) / best error, over restarts, else over seeds; % of the best",
        fontsize=8, loc="left", color=TEXT_COLOUR,
    )  # fmt: skip
    save(figure, paths)


def _draw(
    axes: Axes,
    values: np.ndarray,
    colours: LinearSegmentedColormap,
    norm: Normalize,
    rows: Sequence[str],
    columns: Sequence[tuple[str, str]],
) -> None:
    """A matrix with its labels; what is NaN was not tried or has none."""
    axes.set_facecolor(NOTHING)
    axes.imshow(np.ma.masked_invalid(values), cmap=colours, norm=norm, aspect="auto", interpolation="nearest")
    axes.set_xticks(range(len(columns)), [" ".join(filter(None, c)) for c in columns], rotation=45, ha="right")
    axes.set_yticks(range(len(rows)), rows)
    axes.set_xticks(np.arange(len(columns) + 1) - 0.5, minor=True)
    axes.set_yticks(np.arange(len(rows) + 1) - 0.5, minor=True)
    axes.grid(which="minor", color="white", lw=1)
    axes.tick_params(which="both", length=0, labelsize=8, colors=TEXT_COLOUR)


def _write(axes: Axes, row: int, column: int, text: str, on_dark: bool) -> None:
    axes.text(column, row, text, ha="center", va="center", fontsize=6.5, color="white" if on_dark else TEXT_COLOUR)


def _letters(cell: Cell) -> str:
    return "".join(LETTERS[how] for how in cell.how) + ("!" if cell.silent else "")


def _widest(cell: Cell) -> float | None:
    """Over restarts; a method without restarts has its spread over seeds."""
    return cell.spread if cell.spread is not None else cell.seeds


def _percent(spread: float) -> str:
    percent = 100 * spread
    if percent > 999:
        return ">999"
    return f"{percent:.0f}" if percent >= 0.5 else "0"
