"""The plot of a front: every name can be read."""

from itertools import combinations

from matplotlib.figure import Figure
from matplotlib.text import Annotation

from gpsearch.reports import plot_front

RUN = {"name": "x", "metric": "light", "materials": ["a"], "candidates": 10, "seconds": 60.0}


def drawn(tmp_path, monkeypatch, baselines):
    """The figure that is written for these baselines (name, nodes, error)."""
    figures = []
    save = Figure.savefig

    def keep(figure, *arguments, **options):
        figures.append(figure)
        return save(figure, *arguments, **options)

    monkeypatch.setattr(Figure, "savefig", keep)
    entries = [{"name": name, "nodes": nodes, "error": error} for name, nodes, error in baselines]
    exported = {"run": RUN, "front": [{"nodes": 5, "error": 0.5}], "baselines": entries}
    plot_front(exported, tmp_path / "front.png")
    assert (tmp_path / "front.png").stat().st_size > 10_000
    return figures[0]


def test_names_hide_no_other_and_stay_inside(tmp_path, monkeypatch):
    figure = drawn(
        tmp_path,
        monkeypatch,
        [("beckmann", 71, 0.2722), ("genbrdf-dielectric", 74, 0.2653), ("ggx", 73, 0.2213), ("lambert", 3, 0.8)],
    )
    axes = figure.axes[0]
    boxes = [child.get_window_extent() for child in axes.get_children() if isinstance(child, Annotation)]
    assert len(boxes) == 4
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
    assert all(box.x1 < axes.get_window_extent().x1 for box in boxes)


def test_a_run_without_baselines_is_drawn(tmp_path, monkeypatch):
    assert drawn(tmp_path, monkeypatch, []).axes
