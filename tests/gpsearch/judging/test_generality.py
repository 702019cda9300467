"""Shares below a reference, as figures 6 and 9 of the genBRDF paper have them; what is missing does not count."""

from pathlib import Path

import numpy as np
import pytest

from fitters.scenes import Scene
from gpsearch.judging.contenders import Contender
from gpsearch.judging.generality import ERROR, IMAGES, Scored
from gpsearch.judging.generality_report import Generality, generality_json, generality_text
from gpsearch.judging.scenes import NamedScene
from tests.gpsearch.entries import entry, formula

FIGURE_6 = {
    "steel": (0.083, 0.052, 0.369),
    "two layer gold": (0.087, 0.028, 0.679),
    "green metallic paint": (0.079, 0.040, 0.494),
    "red ornament": (0.096, 0.084, 0.119),
}
"""Cook-Torrance, new, and the improvement that the paper prints, of L^2 on its training set; three digits each."""

AVERAGE = (0.086, 0.051, 0.415)
NAMES = tuple(FIGURE_6)


def scored(values: dict[str, float | None], metric: str = "l2") -> Scored:
    contender = Contender(formula("x", 0.1, 1), {})
    return Scored(contender, {name: {metric: value} for name, value in values.items()})


def test_the_shares_and_averages_are_those_of_the_papers_figure():
    """Its average improvement is the mean of the improvements: 1 - .051 / .086 would be 40.7 %."""
    old = scored({name: row[0] for name, row in FIGURE_6.items()})
    new = scored({name: row[1] for name, row in FIGURE_6.items()})
    for name, (_, _, improvement) in FIGURE_6.items():
        assert new.below(old, name, "l2") == pytest.approx(improvement, abs=0.01)
    assert old.mean(NAMES, "l2") == pytest.approx(AVERAGE[0], abs=5e-4)
    assert new.mean(NAMES, "l2") == pytest.approx(AVERAGE[1], abs=5e-4)
    assert new.mean_below(old, NAMES, "l2") == pytest.approx(AVERAGE[2], abs=3e-3)


def test_a_model_is_no_better_than_itself_and_twice_the_error_is_100_percent_more():
    one, twice = scored({"a": 0.1, "b": 0.3}), scored({"a": 0.2, "b": 0.6})
    assert one.mean_below(one, ("a", "b"), "l2") == 0.0
    assert twice.mean_below(one, ("a", "b"), "l2") == pytest.approx(-1.0)
    assert one.mean_below(twice, ("a", "b"), "l2") == pytest.approx(0.5)


@pytest.mark.parametrize("missing", [None, 0.0])
def test_what_has_no_score_has_no_mean_and_nothing_lies_below_it(missing):
    one, other = scored({"a": 0.1, "b": 0.2}, ERROR), scored({"a": missing, "b": 0.4}, ERROR)
    assert one.below(other, "a", ERROR) is None
    assert one.mean_below(other, ("a", "b"), ERROR) is None
    assert one.mean_below(other, ("b",), ERROR) == pytest.approx(0.5)
    assert other.mean(("a", "b"), ERROR) == (None if missing is None else pytest.approx(np.mean([0.0, 0.4])))


def model(name: str, kind: str, value: float | None) -> Scored:
    """A model with this score by every metric on `a`, and twice it on `b`."""
    contender = Contender(entry(name, kind, 0.1 if value is None else value, nodes=1, expression="p0"), {})
    second = None if value is None else 2 * value
    return Scored(contender, {at: dict.fromkeys((ERROR, *IMAGES), v) for at, v in (("a", value), ("b", second))})


def report(*models: Scored) -> Generality:
    scene = NamedScene("studio", Scene(), Path())
    references = model("cook-torrance", "formula", 0.2), model("ggx", "formula", 0.1)
    found = [one for one in models if one.contender.entry.kind == "found"]
    every = (*models, *references)
    return Generality("metals", scene, "light", ("a",), ("b",), every, found[-1] if found else None)


def test_the_text_has_dashes_for_what_is_missing():
    lines = generality_text(report(model("12345678", "found", 0.05), model("power-iterations", "table", None)))
    (line,) = (line for line in lines.splitlines() if line.startswith("power-iterations"))
    assert line.split()[2:] == ["-"] * 12
    (line,) = (line for line in lines.splitlines() if line.startswith("found 12345678  "))
    assert line.split()[2:] == ["1", *["0.0500", "0.1000"] * 3, *["75.0%"] * 3, *["50.0%"] * 3]
    (line,) = (line for line in lines.splitlines() if line.startswith("  b "))
    assert line.split()[1:] == ["0.4000", "0.2000", "0.1000", "75.0%", "50.0%"] * 3


def test_numbers_of_any_size_stay_in_their_columns():
    lines = generality_text(
        report(model("12345678", "found", 700.0), model("87654321", "found", 0.5))
    ).splitlines()
    rows = [line for line in lines if line.startswith(("found 12345678 ", "found 87654321  ", "ggx "))]
    assert len({len(line) for line in rows}) == 1


def test_without_a_front_there_is_no_member():
    found = report(model("bivariate", "table", 0.1))
    assert generality_json(found)["member"] is None
    assert "training set" not in generality_text(found)
