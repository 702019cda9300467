"""What a chart marks, and that it can be read."""

import csv
import json
import re
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.text import Annotation, Text

from fitters.judging.timing import Timing
from gpsearch.pictures.chart import AXES, Chart, Charted, write_page, write_pictures, write_table
from gpsearch.pictures.chart.look import Frame
from gpsearch.pictures.chart.models import MEASURED, marked
from gpsearch.pictures.chart.picture import TEST_POINTS, drawn
from gpsearch.run import non_dominated
from tests.gpsearch.entries import baseline, information, on_tests

COSTS = st.lists(st.tuples(*[st.integers(0, 4)] * 3), max_size=12)
FORMULA = "p0 / pi + p1 * pow(wh.z, p2) / max(wi.z, 1e-05)"


def model(name: str, error: float | None, **known: object) -> Charted:
    ns = known.pop("ns", 20.0)
    timing = None if ns is None else Timing(float(ns), float(ns) - 1, float(ns) + 1)  # type: ignore[arg-type]
    seconds = known.pop("fit_seconds", 0.5)
    given = {"kind": "formula", "expression": FORMULA, "nodes": 11, "floats": 9}
    return Charted(baseline(name, error, **(given | known)), seconds, timing, timing)  # type: ignore[arg-type]


TABLE = {"kind": "table", "expression": None, "nodes": None}
MODELS = (
    model("small", 0.5, ns=5, nodes=3, floats=3, fit_seconds=0.1),
    model("good", 0.2, ns=30, nodes=40, floats=12, fit_seconds=0.9),
    model("slow", 0.2, ns=90, nodes=40, floats=12, fit_seconds=0.9),
    model("worse than black", 6.5, ns=4, nodes=2, floats=0, fit_seconds=0.05),
    model("big table", 0.1, ns=150, floats=24_300, fit_seconds=1.0, **TABLE),
    model("fails", None, ns=None, floats=0, fit_seconds=2.0, **TABLE | {"kind": "power-iterations"}),
    model(MEASURED, 0.0, ns=400, floats=4_374_000, fit_seconds=None, **TABLE | {"kind": MEASURED}),
)


def chart(models=MODELS, run="a <run> & more") -> Chart:
    about = information(name=run, materials=("metal", "fabric"))
    return Chart(about, Timing(3.0, 2.9, 3.1), tuple(marked(models)))


@given(COSTS)
def test_non_dominated_points_are_those_that_no_other_beats(points):
    def beats(a, b):
        return a != b and all(x <= y for x, y in zip(a, b, strict=True))

    unbeaten = [one for one in points if not any(beats(other, one) for other in points)]
    assert non_dominated(points, lambda point: point, keep_equals=True) == sorted(unbeaten)


def test_every_cost_has_its_own_set_and_all_together_one_more():
    found = {one.entry.name: one for one in marked(MODELS)}
    sets = {axis.key: {name for name, one in found.items() if axis.key in one.unbeaten} for axis in AXES}
    assert sets["ns"] == {"worse than black", "small", "good", "big table", MEASURED}
    # The measured table was not fitted and has no nodes, nor has the other table.
    assert sets["fit_seconds"] == {"worse than black", "small", "good", "slow", "big table"}
    assert sets["nodes"] == {"worse than black", "small", "good", "slow"}
    assert sets["floats"] == {"worse than black", "small", "good", "slow", "big table", MEASURED}
    together = {name for name, one in found.items() if one.unbeaten_together}
    assert together == {"worse than black", "small", "good", "big table", MEASURED}


def test_what_lacks_an_error_or_a_cost_competes_in_nothing():
    (only,) = marked([model("fails", None)])
    assert not only.unbeaten
    assert not only.unbeaten_together


@pytest.mark.parametrize("count", [3, 60])
def test_names_hide_no_other_and_stay_inside(count):
    """Even of many models whose errors are nearly the same."""
    many = [model(f"{i:08x} ({30 + i} nodes)", 0.1 + 1e-4 * i, ns=10 + i, nodes=30 + i) for i in range(count)]
    figure = drawn(chart((*many, *MODELS)))
    figure.canvas.draw()
    names = [child for child in figure.axes[-1].get_children() if isinstance(child, Annotation)]
    assert len(names) == count + len(MODELS) - 1
    boxes = [Text.get_window_extent(name) for name in names]
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
    panel = figure.axes[-1].get_window_extent()
    assert all(panel.x1 < box.x0 and box.x1 < figure.bbox.x1 for box in boxes)
    assert all(box.y0 > 0 and box.y1 < figure.bbox.y1 for box in boxes)


def test_the_picture_says_what_is_not_where_it_is_drawn():
    figure = drawn(chart())
    said = {child.get_text() for child in figure.axes[-1].get_children() if isinstance(child, Annotation)}
    assert {"worse than black: 6.5", "measured table: 0", "small"} <= said
    assert "could not be fitted: fails" in {text.get_text() for text in figure.texts}
    low, high = figure.axes[0].get_ylim()
    assert low < 0.1
    assert 0.5 < high < 1
    # Nothing is drawn where a logarithmic axis has no room.
    for axes in figure.axes:
        marks = [line for line in axes.lines if line.get_marker() != "None"]
        assert len(marks) > len(MODELS) - 4
        assert all(min(line.get_xdata()) > 0 and low <= min(line.get_ydata()) <= high for line in marks)


def test_an_absolute_metric_has_no_upper_edge():
    """The errors of `light-sum` are of no unit: one above 1 is no worse than black."""
    assert Frame(replace(chart(), run=information(metric="light-sum"))).top > 6.5
    assert Frame(chart()).top < 1


def test_pictures_are_files_of_their_kinds(tmp_path):
    paths = [tmp_path / "chart.png", tmp_path / "chart.svg"]
    write_pictures(chart(), paths)
    assert paths[0].read_bytes().startswith(b"\x89PNG")
    assert "<svg" in paths[1].read_text()[:1000]


def test_the_table_has_a_row_for_every_model(tmp_path):
    write_table(chart(), tmp_path / "chart.csv")
    with (tmp_path / "chart.csv").open(newline="") as file:
        rows = {row["name"]: row for row in csv.DictReader(file)}
    assert list(rows) == [one.entry.name for one in MODELS]
    assert rows["good"]["expression"] == FORMULA
    assert float(rows["good"]["ns"]) == 30
    assert (float(rows["good"]["ns_low"]), float(rows["good"]["ns_high"])) == (29, 31)
    assert (rows["good"]["non_dominated"], rows["slow"]["non_dominated"]) == ("True", "False")
    assert rows["fails"]["error"] == rows["fails"]["ns"] == rows["fails"]["nodes"] == ""
    assert rows[MEASURED]["error"] == "0.0"


def with_test(one: Charted, error: float) -> Charted:
    return replace(one, entry=replace(one.entry, test=on_tests(error)))


TESTED = tuple(
    one if one.error is None else with_test(one, 0.0 if one.entry.name == MEASURED else 1.5 * one.error)
    for one in MODELS
)


def chart_with_tests() -> Chart:
    return with_tests(chart(TESTED), "a", "b")


def with_tests(plain: Chart, *names: str) -> Chart:
    return replace(plain, run=replace(plain.run, test_materials=names))


def test_errors_on_test_materials_are_hollow_marks_joined_to_the_models_own():
    """In every panel, one for each model that has both; nothing else is drawn otherwise."""
    plain, tested = drawn(chart()), drawn(chart_with_tests())
    for axis, before, after in zip(AXES, plain.axes, tested.axes, strict=True):
        expected = [one for one in TESTED if one.entry.test_error and one.cost(axis.key) is not None]
        expected = [one for one in expected if one.entry.name != "worse than black"]
        hollow = [line for line in after.lines if line.get_markersize() == TEST_POINTS]
        assert len(after.lines) - len(before.lines) == 2 * len(hollow)
        assert sorted(line.get_ydata()[0] for line in hollow) == pytest.approx(
            sorted(one.entry.test_error for one in expected)
        )
        assert all(line.get_markerfacecolor() == "white" for line in hollow)
        joints = {tuple(line.get_ydata()) for line in after.lines if len(line.get_ydata()) == 2}
        assert joints >= {(one.error, one.entry.test_error) for one in expected}
        low, high = after.get_ylim()
        assert all(low <= line.get_ydata()[0] <= high for line in hollow)
    labels = [text.get_text() for text in tested.legends[0].get_texts()]
    assert "error on the test materials" in labels
    assert "error on the test materials" not in [text.get_text() for text in plain.legends[0].get_texts()]
    assert "tested on 2 others" in tested.get_suptitle()


def test_an_error_on_test_materials_widens_the_axis():
    wide = with_test(MODELS[0], 0.95)
    assert Frame(with_tests(chart((wide, *MODELS[1:])), "a")).top > 0.95


def test_the_table_has_test_errors_where_there_are_test_materials(tmp_path):
    write_table(chart(), tmp_path / "plain.csv")
    write_table(chart_with_tests(), tmp_path / "tested.csv")
    columns, rows = [], []
    for name in ("plain.csv", "tested.csv"):
        with (tmp_path / name).open(newline="") as file:
            read = csv.DictReader(file)
            rows.append(list(read))
            columns.append(read.fieldnames)
    assert [name for name in columns[1] if name != "test_error"] == columns[0]
    assert columns[1].index("test_error") == columns[1].index("error") + 1
    for row, model in zip(rows[1], TESTED, strict=True):
        assert row.pop("test_error") == ("" if model.entry.test_error is None else str(model.entry.test_error))
    assert rows[0] == rows[1]


def test_the_page_says_test_errors_where_one_points(tmp_path):
    write_page(chart_with_tests(), tmp_path / "tested.html")
    write_page(chart(), tmp_path / "plain.html")
    texts = [text for trace in traces(tmp_path / "tested.html") for text in trace.get("hovertext", ())]
    assert any("small" in text and "error on test materials 0.75" in text for text in texts)
    assert "on test materials" not in (tmp_path / "plain.html").read_text()


def traces(page: Path) -> list[dict]:
    """The traces that a page gives to plotly."""
    text = page.read_text()
    start = text.index("[", text.index("Plotly.newPlot(", text.rindex("PlotlyConfig")))
    found, _ = json.JSONDecoder().raw_decode(text, start)
    return found


def test_the_page_needs_no_network_and_escapes_names(tmp_path):
    write_page(chart(), tmp_path / "chart.html")
    text = (tmp_path / "chart.html").read_text()
    assert "<title>a &lt;run&gt; &amp; more" in text
    assert not re.search(r"<(script|link|img)[^>]*(src|href)=", text)
    assert "Could not be fitted: fails." in text


def test_the_page_shows_every_model_in_every_panel_where_it_has_a_cost(tmp_path):
    write_page(chart(), tmp_path / "chart.html")
    panels: dict[str, set[str]] = {}
    for trace in (trace for trace in traces(tmp_path / "chart.html") if "hovertext" in trace):
        for text, about in zip(trace["hovertext"], trace["customdata"], strict=True):
            panels.setdefault(trace["xaxis"], set()).add(about[0])
            assert about[0] in text
            assert about[2] == (FORMULA if about[0] not in ("big table", MEASURED) else "")
    for axis, names in zip(AXES, panels.values(), strict=True):
        expected = {one.entry.name for one in MODELS if one.error is not None and one.cost(axis.key) is not None}
        assert names == expected
