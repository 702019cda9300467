"""front.json: what its schema says, and that its numbers mean what they say."""

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from fitters.expressions import evaluate, parse
from fitters.grid import cell_directions
from fitters.materials import load_material
from fitters.scenes import Scene, light_table
from gpsearch import __version__
from gpsearch.exports import schema
from gpsearch.genomes import Genome, reify
from gpsearch.run import Store, result_of
from tests.gpsearch.small import LAMP, Watching, make_store, run_search, small

MATERIALS = ["builtin:metal", "builtin:fabric"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("export")
    run_search(folder / "run", configuration(folder)).close()
    return folder


def configuration(folder: Path):
    baselines = ["lambert", "bivariate", "ggx"]
    return small(folder, materials=MATERIALS, baselines=baselines, budget={"generations": 8}, culling=0.01)


@pytest.fixture
def exported(folder: Path) -> dict[str, Any]:
    """The export as a reader of the file gets it."""
    store = Store.open(folder / "run")
    text = result_of(store, configuration(folder)).to_text()
    store.close()
    return json.loads(text)


def test_an_export_fulfils_its_schema(exported):
    jsonschema.Draft202012Validator.check_schema(schema())
    jsonschema.validate(exported, schema(), jsonschema.Draft202012Validator)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("schema",), "gpsearch-front/2"),
        (("run", "seed"), -1),
        (("front", 0, "error"), None),
        (("front", 0, "error"), "0.1"),
        (("front", 0, "surprise"), 1),
        (("front", 0, "nodes"), 0),
        (("front", 0, "parameters", "q0"), {}),
        (("front", 0, "errors", "metal"), [0.1, 0.2]),
        (("front", 0, "genome"), [{"edit": "swap", "first": "a.0"}]),
        (("front", 0, "genome"), [{"edit": "turn", "at": "a.0"}]),
        (("baselines", 0, "floats"), 1.5),
        (("baselines", 0, "kind"), "guess"),
    ],
)
def test_the_schema_refuses_what_is_wrong(exported, path, value):
    *way, last = path
    place: Any = exported
    for key in way:
        place = place[key]
    place[last] = value
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(exported, schema(), jsonschema.Draft202012Validator)


def test_the_run_is_described(exported, folder):
    run = exported["run"]
    assert (run["name"], run["seed"], run["version"]) == ("small", 5, __version__)
    assert run["config_sha256"] == configuration(folder).sha256
    assert run["materials"] == ["metal", "fabric"]
    scene = {"light": LAMP, "rotation": 0.0, "resolution": 16, "light_rows": 8}
    assert run["scene"] == {**scene, "geometry": "sphere", "shape": None, "shadows": True}
    assert (run["generations"], run["candidates"], run["metric"]) == (8, 128, "light")
    assert [baseline["name"] for baseline in exported["baselines"]] == ["lambert", "bivariate", "ggx"]


def test_a_reference_fit_is_described_without_a_formula(exported):
    bivariate, formula = exported["baselines"][1:]
    assert formula.keys() - bivariate.keys() == {"expression", "nodes", "parameters"}
    assert (formula["kind"], bivariate["kind"]) == ("formula", "table")
    assert bivariate["floats"] == 3 * 90 * 90
    errors = np.array(list(bivariate["errors"].values()))
    assert bivariate["errors"].keys() == {"metal", "fabric"}
    assert bivariate["error"] == bivariate["metrics"]["light"] == pytest.approx(np.sqrt(np.mean(errors**2)))
    assert bivariate["metrics"].keys() == formula["metrics"].keys()
    assert bivariate["cost_ns"] > 0
    assert bivariate["warnings"] == []


def test_members_come_by_size_with_strictly_falling_error(exported):
    front = exported["front"]
    assert len(front) > 1
    for smaller, larger in pairwise(front):
        assert smaller["nodes"] < larger["nodes"]
        assert smaller["error"] > larger["error"]
    assert len({member["id"] for member in front}) == len(front)


def test_members_are_what_their_genomes_make_and_as_large_as_stated(exported):
    for member in exported["front"]:
        expression = parse(member["expression"])
        assert expression.nodes == member["nodes"]
        made = parse(member["culled"]["from"]) if "culled" in member else expression
        assert reify(Genome.from_json(member["start"], member["genome"])) == made
        assert tuple(member["parameters"]) == expression.parameters
        assert member["metrics"]["light"] == member["error"]


def test_the_parameters_reproduce_the_stated_errors(exported):
    """Evaluated here with NumPy from the text of the file, the measurements and the light alone."""
    light = light_table(Scene(light=LAMP, resolution=16, light_rows=8))
    carried = light.table.reshape(3, -1).astype(np.float64)
    w_i, w_o = cell_directions()
    formulas = [baseline for baseline in exported["baselines"] if baseline["kind"] == "formula"]
    for entry in exported["front"] + formulas:
        expression, squares = parse(entry["expression"]), []
        for name in ("metal", "fabric"):
            material = load_material(f"builtin:{name}")
            cells = np.flatnonzero((light.lit & material.valid).ravel())
            for channel in range(3):
                parameters = {p: by_material[name][channel] for p, by_material in entry["parameters"].items()}
                values = evaluate(expression, parameters, w_i[cells], w_o[cells])
                measured = material.table[channel].ravel()[cells].astype(np.float64)
                weight = carried[channel, cells]
                error = np.linalg.norm(weight * (values - measured)) / np.linalg.norm(weight * measured)
                assert entry["errors"][name][channel] == pytest.approx(error, rel=1e-5)
                squares.append(error**2)
        assert entry["error"] == pytest.approx(np.sqrt(np.mean(squares)), rel=1e-5)


def test_the_same_run_gives_the_same_text(folder):
    texts = set()
    for _ in range(2):
        store = Store.open(folder / "run")
        texts.add(result_of(store, configuration(folder)).to_text())
        store.close()
    assert len(texts) == 1


def test_a_run_without_generations_has_an_empty_front(tmp_path):
    store = Store.open(make_store(tmp_path / "run", ""))
    exported = result_of(store, small(tmp_path)).to_json()
    jsonschema.validate(exported, schema(), jsonschema.Draft202012Validator)
    assert (exported["front"], exported["run"]["generations"]) == ([], 0)


def test_members_that_are_not_described_yet_are_left_out(tmp_path):
    def stop(event: str) -> None:
        if event == "describing the front":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_search(tmp_path / "run", small(tmp_path, budget={"generations": 1}), Watching(stop))
    store = Store.open(tmp_path / "run")
    assert store.front().members
    assert result_of(store, small(tmp_path)).to_json()["front"] == []
