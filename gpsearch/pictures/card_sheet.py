"""The accuracy card of a model as a picture: measured, model, error; a row for each material."""

from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.image import AxesImage
from matplotlib.patches import Circle

from fitters.grid import Array
from fitters.judging.card import REGION, error_map
from fitters.judging.metrics import CARD_METRICS
from fitters.rendering.picture import Picture, displayed, exposure
from gpsearch.judging.cards import Shown
from gpsearch.judging.contenders import Contender
from gpsearch.pictures.theme import TEXT_COLOUR, new_figure, save

COLUMNS = ("measured", "model", "error (FLIP)")
ERROR_COLOURS = "magma"
MARK_COLOUR = "#4fc3f7"
LONGEST = 110
"""Characters of a formula that are shown."""


def card_sheet(
    contender: Contender, shown: Sequence[Shown], scene: str, path: Path, *, tests: Collection[str] = ()
) -> None:
    """Writes the sheet of a model (`shown` not empty) as the image format that the suffix names.

    `tests` are the materials that the search was not on, and are called so. Pictures have the exposure of the
    measured one; the circle marks the worst region.
    """
    figure = new_figure(8.6, 0.75 + 2.1 * len(shown), dpi=130)
    rows = figure.subplots(len(shown), 4, squeeze=False, width_ratios=(1, 1, 1.07, 1.15))
    highest = max(float(error_map(one.truth, one.picture).max()) for one in shown)
    for axes, one in zip(rows, shown, strict=True):
        scale = exposure(one.truth)
        _image(axes[0], _on_white(one.truth, scale))
        _image(axes[1], _on_white(one.picture, scale))
        errors = np.ma.masked_where(~one.truth.foreground, error_map(one.truth, one.picture))
        image = _image(axes[2], errors, cmap=ERROR_COLOURS, vmin=0.0, vmax=max(highest, 1e-6))
        bar = figure.colorbar(image, ax=axes[2], fraction=0.05, pad=0.02)
        bar.ax.tick_params(labelsize=6, colors=TEXT_COLOUR)
        for one_axes in axes[1:3]:
            _mark(one_axes, one)
        _write(axes[3], one)
        label = f"{one.material} (test)" if one.material in tests else one.material
        axes[0].set_ylabel(label, fontsize=8, color=TEXT_COLOUR)
    for one_axes, title in zip(rows[0], COLUMNS, strict=False):
        one_axes.set_title(title, fontsize=8, color=TEXT_COLOUR)
    figure.suptitle(_title(contender, scene), fontsize=8.5, color=TEXT_COLOUR)
    save(figure, [path])


def _title(contender: Contender, scene: str) -> str:
    formula = contender.entry.expression or ""
    cut = formula if len(formula) <= LONGEST else f"{formula[: LONGEST - 3]}..."
    return f"{contender.entry.title}, {contender.entry.floats:,} floats a material, under {scene}" + (
        f"\n{cut}" if cut else ""
    )


def _on_white(picture: Picture, scale: float) -> Array:
    return np.where(picture.foreground[..., None], displayed(picture, scale), 1.0)


def _image(axes: Axes, image: Array, **options: object) -> AxesImage:
    axes.set_xticks([])
    axes.set_yticks([])
    for side in axes.spines.values():
        side.set_visible(False)
    return axes.imshow(image, interpolation="nearest", **options)  # type: ignore[arg-type]


def _mark(axes: Axes, one: Shown) -> None:
    worst, height = one.card.worst, one.truth.foreground.shape[0]
    centre = (worst.column, worst.row)
    axes.add_patch(
        Circle(centre, 2 * max(REGION * height, 1.0), fill=False, color=MARK_COLOUR, lw=1.1, clip_on=False)
    )


def _write(axes: Axes, one: Shown) -> None:
    axes.axis("off")
    lines = [f"{name:17s}{number(one.card.metrics[name])}" for name in CARD_METRICS]
    worst = one.card.worst
    lines += ["", f"worst region: FLIP {worst.error:.3f}", f"  seen at {worst.facing:.0f} deg"]
    axes.text(
        0.0, 0.98, "\n".join(lines), va="top", fontsize=6.5, family="monospace", color=TEXT_COLOUR,
        transform=axes.transAxes,
    )  # fmt: skip


def number(value: float) -> str:
    """Four significant digits; of equal pictures `equal`."""
    return f"{value:.4g}" if np.isfinite(value) else "equal"
