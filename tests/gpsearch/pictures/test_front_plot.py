"""The plot of a front: every name can be read."""

from itertools import combinations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from matplotlib.text import Annotation, Text
from matplotlib.transforms import Bbox

from gpsearch.pictures.front_plot import plot_front
from gpsearch.pictures.labels import spread
from tests.gpsearch.entries import baseline, formula, result


def drawn(tmp_path, monkeypatch, baselines, front=((5, 0.5),)):
    """The figure that is written for these baselines (name, nodes, error); nodes None for a reference fit."""
    figures = []
    save = Figure.savefig

    def keep(figure, *arguments, **options):
        figures.append(figure)
        return save(figure, *arguments, **options)

    monkeypatch.setattr(Figure, "savefig", keep)
    formulas = [formula(f"f{nodes}", error, nodes) for nodes, error in front]
    entries = [baseline(name, error, nodes=nodes) for name, nodes, error in baselines]
    plot_front(result(*formulas, *entries), tmp_path / "front.png")
    assert (tmp_path / "front.png").stat().st_size > 10_000
    return figures[0]


def test_names_hide_no_other_and_stay_inside(tmp_path, monkeypatch):
    figure = drawn(
        tmp_path,
        monkeypatch,
        [("beckmann", 71, 0.2722), ("genbrdf-dielectric", 74, 0.2653), ("ggx", 73, 0.2213), ("lambert", 3, 0.8)],
    )
    boxes = apart(figure)
    assert len(boxes) == 4
    assert all(box.x1 < figure.axes[0].get_window_extent().x1 for box in boxes.values())


def apart(figure: Figure) -> dict[str, Bbox]:
    """Where the names of a figure stand, by name; none hides another."""
    texts = [child for child in figure.axes[0].get_children() if isinstance(child, Annotation)]
    boxes = {text.get_text(): Text.get_window_extent(text) for text in texts}
    assert len(boxes) == len(texts)
    assert not any(one.overlaps(other) for one, other in combinations(boxes.values(), 2))
    return boxes


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.axes[0].get_legend().get_texts()]


ALIKE = [("npf-naive", None, 0.0251), ("npf-independent-g", None, 0.025), ("npf-g-from-d", None, 0.025)]


def test_reference_fits_are_lines_named_beside_the_axes(tmp_path, monkeypatch):
    """Also where their errors are alike."""
    baselines = [("ggx", 73, 0.2213), ("bivariate", None, 0.04), *ALIKE]
    figure = drawn(tmp_path, monkeypatch, baselines)
    axes, page = figure.axes[0], figure.bbox
    assert legend(figure) == ["found by the search", "published, refitted", "tabulated references"]
    across = [line.get_ydata()[0] for line in axes.get_lines() if list(line.get_xdata()) == [0, 1]]
    assert across == [0.025, 0.025, 0.0251, 0.04]
    boxes = apart(figure)
    del boxes["ggx"]
    assert sorted(boxes, key=lambda name: boxes[name].y0) == [
        "npf-g-from-d",
        "npf-independent-g",
        "npf-naive",
        "bivariate",
    ]
    for box in boxes.values():
        assert axes.get_window_extent().x1 < box.x0 < box.x1 < page.x1
        assert page.y0 < box.y0 < box.y1 < page.y1


def test_a_reference_fit_much_worse_than_all_else_does_not_squeeze_the_front(tmp_path, monkeypatch):
    figure = drawn(tmp_path, monkeypatch, [("ggx", 73, 0.2), ("power-iterations", None, 57.3), *ALIKE])
    axes = figure.axes[0]
    assert axes.get_ylim()[1] < 1
    box = apart(figure)["power-iterations (57 ↑)"]
    assert box.y0 < axes.get_window_extent().y1 < box.y1


def test_reference_fits_alone_are_drawn(tmp_path, monkeypatch):
    figure = drawn(tmp_path, monkeypatch, [*ALIKE, ("power-iterations", None, 57.3)], front=[])
    assert legend(figure) == ["tabulated references"]
    assert len(apart(figure)) == 4


def test_a_reference_fit_that_failed_is_left_out(tmp_path, monkeypatch):
    figure = drawn(tmp_path, monkeypatch, [("power-iterations", None, None)])
    assert legend(figure) == ["found by the search"]


@given(st.lists(st.floats(0, 100), min_size=1, max_size=8), st.floats(1, 12))
def test_names_are_spread_in_order_within_the_axes(wanted, spacing):
    places = spread(np.sort(wanted), spacing, 0.0, 100.0)
    assert np.all(np.diff(places) >= spacing - 1e-9)
    assert places[0] >= 0
    assert places[-1] <= 100 + 1e-9


def test_a_run_without_baselines_is_drawn(tmp_path, monkeypatch):
    assert drawn(tmp_path, monkeypatch, []).axes
