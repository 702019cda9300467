"""`gpsearch pick`: what it picks is the cheapest of all that it lists, and really within the tolerance."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from fitters.expressions import parse
from fitters.fitting import model_errors
from fitters.fitting.problem import Problem
from fitters.judging.card import Judge
from fitters.judging.metrics import CARD_METRICS
from fitters.materials.synthetic import load
from fitters.models import FormulaModel
from fitters.models.factors import BivariateTable
from fitters.scenes import Scene, light_table
from gpsearch.judging.offers import View
from gpsearch.judging.scenes import NamedScene
from gpsearch.judging.tolerance import parse_tolerance
from tests.gpsearch.small import FEW, LAMP, gpsearch, run_search, small, small_text

NAMES = ("metal", "rough-plastic")
LIMIT = 0.4
"""Of the light error: some formulas reach it, others do not."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the run of two materials in `run`, and a configuration with another scene."""
    folder = tmp_path_factory.mktemp("pick")
    changes = {"baselines": ["lambert", "ggx", "bivariate"], "budget": {"generations": 1}, "search": FEW}
    run_search(folder / "run", small(folder, materials=[f"builtin:{name}" for name in NAMES], **changes)).close()
    (folder / "grey.yaml").write_text(small_text(scene={"light": "overcast"}))
    return folder


def picked(folder: Path, tolerance: str, *options: str) -> list[dict]:
    result = gpsearch("pick", "run", "--tolerance", tolerance, "--json", *options, cwd=folder)
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)["scenes"]


@pytest.fixture(scope="module")
def within_limit(folder):
    """Picked in the run's scene."""
    return picked(folder, f"light<={LIMIT}")[0]


def words(model: dict, materials: int) -> int:
    """To store for so many materials where nothing is shared."""
    return (model["nodes"] or 0) + model["floats"] * materials


def of(found: dict, names: tuple[str, ...]) -> dict:
    return found["all"] if len(names) > 1 else found["materials"][names[0]]


def formula_models(pick: dict, names: tuple[str, ...]) -> dict[str, FormulaModel]:
    """The models that the JSON alone describes."""
    expression = parse(pick["expression"])
    columns = {name: [pick["parameters"][symbol][name] for symbol in expression.parameters] for name in names}
    return {name: FormulaModel(expression, np.array(columns[name]).T) for name in names}


@pytest.mark.parametrize("names", [NAMES[:1], NAMES[1:], NAMES])
def test_the_pick_is_the_cheapest_of_all_that_is_listed(within_limit, names):
    pick, models = of(within_limit, names), within_limit["models"]
    within = [model for model in models if all(model["values"][name]["light"] <= LIMIT for name in names)]
    assert 0 < len(within) < len(models)
    assert pick["within"]
    assert pick["name"] in [model["name"] for model in within]
    assert pick["words"] <= min(words(model, len(names)) for model in within)


@pytest.mark.parametrize("names", [NAMES[:1], NAMES[1:], NAMES])
def test_the_parameters_of_the_pick_have_the_errors_and_the_count_that_it_says(within_limit, names):
    pick = of(within_limit, names)
    light = light_table(Scene(LAMP, resolution=16, light_rows=8))
    for name, model in formula_models(pick, names).items():
        error = np.sqrt(np.mean(np.square(model_errors(Problem([load(name)], light), 0, model)["light"])))
        assert error == pytest.approx(pick["values"][name]["light"], rel=1e-9)
        assert LIMIT - error == pytest.approx(pick["margins"][name]["light"], rel=1e-6)
        assert error <= LIMIT
    sizes = {"channel": 3 * len(names), "material": len(names), "set": 1}
    assert pick["numbers"] == sum(sizes[scope] for scope in pick["sharing"].values())
    assert pick["words"] == pick["nodes"] + pick["numbers"]
    different = [{v for three in by_name.values() for v in three} for by_name in pick["parameters"].values()]
    assert sum(map(len, different)) <= pick["numbers"] <= 3 * len(names) * len(different)


def test_numbers_are_shared(within_limit):
    """The set's pick takes fewer numbers than the same formula, free: 40 % of error leaves room for it."""
    pick = within_limit["all"]
    assert pick["numbers"] < next(m["floats"] for m in within_limit["models"] if m["name"] == pick["name"]) * 2
    assert set(pick["sharing"].values()) != {"channel"}


def test_what_is_measured_is_what_cards_say():
    """By every metric; of a table, whose picture nothing here fits."""
    scene, material = NamedScene("studio", Scene("studio", resolution=16, light_rows=8), Path()), load("metal")
    limits = [f"{metric.name}{'>' if metric.higher_is_better else '<'}1" for metric in CARD_METRICS.values()]
    every = " and ".join(limits)
    model = BivariateTable(B=np.full((90, 90, 3), 0.2))
    values = View(scene, [material], parse_tolerance(every)).values(model, "metal")
    card, _ = Judge(scene.image(), scene.light(), material).card(model)
    assert values == pytest.approx(card.metrics, rel=1e-5)


def test_in_another_scene_formulas_are_refitted_and_the_picture_shows_both(folder):
    (folder / "own.yaml").write_text(yaml.safe_dump(yaml.safe_load(small_text()) | {"name": "own"}))
    options = ("--scene", "own.yaml", "--scene", "grey.yaml", "--plot", "scenes.png")
    result = gpsearch("pick", "run", "--tolerance", "light<1e-9", *options[:2], cwd=folder)
    assert (result.returncode, result.stdout.count("none; nearest")) == (0, 3)
    own, grey = picked(folder, "light<1e-9", *options)
    assert (folder / "scenes.png").stat().st_size > 10_000
    assert {model["fitted_in"] for model in own["models"]} == {"run"}
    ways: dict[str, dict] = {model["name"]: {} for model in grey["models"]}
    for model in grey["models"]:
        ways[model["name"]][model["fitted_in"]] = [model["values"][name]["light"] for name in NAMES]
    assert set(ways["bivariate"]) == {"run"}
    for way in (way for name, way in ways.items() if name != "bivariate"):
        # The error that a refit minimises is the mean square over materials.
        assert np.linalg.norm(way["scene"]) <= 1.001 * np.linalg.norm(way["run"])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("run", "--tolerance", "psnrr>=45"), "did you mean psnr?"),
        (("run", "--tolerance", "psnr>=45", "--scene", "nowhere.hdr"), "nowhere.hdr"),
        (("run", "--tolerance", "psnr>=45", "--plot", "scenes.txt"), ".png or .svg"),
        (("run", "--tolerance", "psnr>=45", "--by", "price"), "size"),
        (("run",), "--tolerance"),
        (("nothing", "--tolerance", "psnr>=45"), "nothing"),
    ],
)
def test_bad_input_is_one_message_and_exit_status_2(folder, options, words):
    result = gpsearch("pick", *options, cwd=folder)
    assert (result.returncode, result.stdout) == (2, "")
    assert words in result.stderr
    assert "Traceback" not in result.stderr
