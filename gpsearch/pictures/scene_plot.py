"""What several scenes ask for: every model's metric against its size, a panel for each scene, the picks marked."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes

from fitters.judging.metrics import METRICS
from gpsearch.judging.offers import Offer
from gpsearch.judging.scene_picks import ScenePicks
from gpsearch.judging.tolerance import Limit, Tolerance
from gpsearch.pictures.theme import (
    DASHES,
    FOUND_COLOUR,
    PICK_COLOUR,
    PUBLISHED_COLOUR,
    TABLE_COLOUR,
    TEXT_COLOUR,
    new_figure,
    save,
    style,
)

STYLES = {"found": (FOUND_COLOUR, "o", "found"), "formula": (PUBLISHED_COLOUR, "D", "published")}
TABLE_STYLE = (TABLE_COLOUR, "s", "tables")


def plot_scenes(scenes: Sequence[ScenePicks], tolerance: Tolerance, path: Path) -> None:
    """Writes the plot by the tolerance's first limit, worst over the materials, as the suffix's format."""
    figure = new_figure(1.2 + 3.9 * len(scenes), 4.2)
    panels = figure.subplots(1, len(scenes), sharex=True, sharey=True, squeeze=False)[0]
    limit = tolerance.limits[0]
    for axes, one in zip(panels, scenes, strict=True):
        _panel(axes, one, limit)
    panels[0].set_ylabel(f"{limit.metric}, worst material")
    panels[0].set_xscale("log")
    if not METRICS[limit.metric].higher_is_better:
        panels[0].set_yscale("log")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False, fontsize=8)
    save(figure, [path])


def _panel(axes: Axes, picks: ScenePicks, limit: Limit) -> None:
    names = tuple(picks.alone)
    for kind in dict.fromkeys(_style(offer) for offer in picks.offered):
        whole = [o for o in picks.offered if _style(o) == kind and set(names) <= set(o.models)]
        colour, marker, label = kind
        sizes, values = [o.words(len(names)) for o in whole], [_worst(o, names, limit) for o in whole]
        axes.plot(sizes, values, marker, color=colour, ms=4, alpha=0.8, label=label)
    axes.axhline(limit.bound, color=TEXT_COLOUR, lw=0.8, ls=DASHES, label=str(limit))
    said = "no model of all materials"
    if (picked := picks.together) is not None:
        x, y = picked.offer.words(len(names)), _worst(picked.offer, names, limit)
        axes.plot(x, y, "o", ms=11, mfc="none", mec=PICK_COLOUR, mew=1.5, label="picked for all")
        said = f"{'the cheapest for all' if picked.within else 'none is within; nearest'}: "
        said += picked.offer.contender.entry.title
    axes.set_title(f"{picks.scene.name}\n{said}", fontsize=9, color=TEXT_COLOUR)
    axes.set_xlabel(f"words to store for {len(names)} materials")
    style(axes)


def _style(offer: Offer) -> tuple[str, str, str]:
    return STYLES.get(offer.contender.entry.kind, TABLE_STYLE)


def _worst(offer: Offer, names: Sequence[str], limit: Limit) -> float:
    return min((offer.values[name][limit.metric] for name in names), key=limit.margin)
