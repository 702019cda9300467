"""What a configuration holds once it is loaded."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import pytest
from pydantic import ValidationError

from fitters.expressions import parse, to_text
from fitters.expressions.catalogue import CATALOGUE
from fitters.fitting import FitSettings
from fitters.models import BASELINES
from fitters.scenes import Scene
from gpsearch.configuration import (
    DaskExecutorSection,
    LocalExecutorSection,
    load_configuration,
    parse_configuration,
)
from gpsearch.configuration.sections import executor_section
from gpsearch.errors import GpsearchError
from workers import Executor


def test_materials_alone_are_enough_and_the_rest_is_as_in_the_paper(load):
    configuration = load("materials: [builtin:metal, builtin:fabric]")
    search, fit = configuration.search, configuration.fit
    assert (configuration.name, configuration.seed, configuration.metric) == ("quick", 0, "light")
    assert configuration.materials == ("builtin:metal", "builtin:fabric")
    assert configuration.scene.recipe == Scene()
    assert configuration.executor == LocalExecutorSection()
    assert (configuration.budget.generations, search.islands, search.island_size) == (100, 4, 1024)
    assert (search.migrate_every, search.migrants, search.parameters) == (5, 1, 4)
    assert configuration.search.start_expressions() == (CATALOGUE["cook-torrance"].expression,)
    assert configuration.search.codebank_expressions() == within_parameters(4)
    assert search.bounds == (1e-6, 1e5)
    assert (fit.cells, fit.confirm_cells, fit.settings) == (2048, 16384, FitSettings())
    formulas, tables = ("cook-torrance", "ggx"), ("bivariate", "npf-independent-g", "npf-g-from-d", "npf-naive")
    assert configuration.baselines == (*formulas, *tables, "power-iterations")


def test_every_key_is_read(load, tmp_path):
    (tmp_path / "a.bsdf").touch()
    (tmp_path / "sky.exr").touch()
    configuration = load(
        """
name: every-key_1.0
seed: 7
materials:
  - a.bsdf
scene: {light: sky.exr, rotation: 30, resolution: 32, light_rows: 24}
metric: compressive
executor: {kind: dask, scheduler: "tcp://host:8786", workers: 2, wait_seconds: 5}
budget: {generations: null, minutes: 2.5, candidates: 1000}
search:
  start: [ggx, "p0*max(wi.z,p1)"]
  codebank: [phong]
  islands: 2
  island_size: 16
  tournament: 3
  migrate_every: 2
  migrants: 2
  max_nodes: 80
  parameters: 6
  bounds: [-1, 1]
  edits: {swap: 0, insert: 2, replace: 1.5, delete: 0}
fit: {cells: 64, confirm_cells: 128, starts: 9, restarts: 1, rounds: 0, evaluations: 10, tolerance: 1e-3}
culling: 0.05
baselines: []
"""
    )
    assert configuration.scene.recipe == Scene("sky.exr", 30.0, 32, 24)
    assert configuration.executor == DaskExecutorSection(
        kind="dask", scheduler="tcp://host:8786", workers=2, wait_seconds=5
    )
    assert configuration.budget.model_dump() == {"generations": None, "minutes": 2.5, "candidates": 1000}
    assert configuration.search.start_expressions()[1] == parse("p0 * max(wi.z, p1)")
    assert configuration.search.codebank_expressions() == (CATALOGUE["phong"].expression,)
    assert configuration.search.edits.replace == 1.5
    assert configuration.fit.settings == FitSettings(9, 1, 0, 10, 1e-3)
    assert (configuration.culling, configuration.baselines) == (0.05, ())


def test_a_scene_file_may_be_looked_at_in_part(load, tmp_path):
    (tmp_path / "room.xml").touch()
    scene = load("scene: {geometry: room.xml, shape: lamp, shadows: false}").scene
    assert scene.recipe == Scene(geometry="room.xml", shape="lamp", shadows=False)


def test_baselines_are_formulas_and_reference_fits(load):
    names = BASELINES
    assert load(f"baselines: [{', '.join(names)}]").baselines == names


def test_a_stored_run_with_a_baseline_twice_still_opens(tmp_path):
    text = "materials: [builtin:metal]\nbaselines: [ggx, ggx]\n"
    stored = parse_configuration(text, source="run.sqlite", folder=tmp_path, check_files=False)
    assert stored.baselines == ("ggx", "ggx")


def test_a_stored_run_of_two_materials_of_one_name_still_opens(tmp_path):
    text = "materials: [a/x.bsdf, b/x.bsdf]\n"
    stored = parse_configuration(text, source="run.sqlite", folder=tmp_path, check_files=False)
    assert stored.material_names == ("x", "x")


def test_test_materials_are_none_by_default_and_have_names(load):
    assert load("seed: 0").test_materials == ()
    assert load("test_materials: [builtin:fabric]").test_material_names == ("fabric",)


def test_a_stored_run_whose_tls_was_configured_elsewhere_still_opens(tmp_path):
    text = "materials: [builtin:metal]\nexecutor: {kind: dask, scheduler: tls://a:1}\n"
    stored = parse_configuration(text, source="run.sqlite", folder=tmp_path, check_files=False)
    assert stored.executor == DaskExecutorSection(kind="dask", scheduler="tls://a:1")


@pytest.mark.parametrize(
    ("text", "kind"),
    [("local", "local"), ("{kind: local}", "local"), ("dask", "dask"), ("{kind: dask}", "dask")],
)
def test_an_executor_may_be_its_kind_alone(load, text, kind):
    assert load(f"executor: {text}") == load(f"executor: {kind}")
    assert load(f"executor: {text}").executor.kind == kind


def test_numbers_that_yaml_takes_for_texts_are_read(load):
    configuration = load("search: {bounds: [1e-6, 1e+5]}\nbudget: {generations: 1e3}\nfit: {tolerance: 1e-4}")
    assert configuration.search.bounds == (1e-6, 1e5)
    assert configuration.budget.generations == 1000
    assert configuration.fit.tolerance == 1e-4


def test_one_string_is_a_list_of_one(load):
    assert load("search: {start: ggx, codebank: ward}").search.start == ("ggx",)


def test_all_of_the_codebank_may_be_joined_by_more(load):
    expressions = load("search: {codebank: [all, ggx, 'p0 * wi.z']}").search.codebank_expressions()
    assert [to_text(e) for e in expressions[-1:]] == ["p0 * wi.z"]
    assert expressions[:-1] == within_parameters(4)


def test_all_of_the_codebank_keeps_within_the_parameters(load):
    expressions = load("search: {parameters: 2, start: oren-nayar}").search.codebank_expressions()
    assert CATALOGUE["lambert"].expression in expressions
    assert CATALOGUE["ggx"].expression not in expressions
    assert load("search: {parameters: 8}").search.codebank_expressions() == within_parameters(8)
    assert set(CATALOGUE) - {f.name for f in CATALOGUE.values() if f.expression in within_parameters(8)} == {"sgd"}


def test_a_group_holds_what_was_published_before_the_paper(load):
    expressions = load("search: {codebank: published-2013, parameters: 8}").search.codebank_expressions()
    later = {"genbrdf-metal", "genbrdf-dielectric"}
    assert expressions == within_parameters(8, without=later)
    assert all(CATALOGUE[name].expression in expressions for name in ("ggx", "abc", "disney-specular"))
    assert not any(CATALOGUE[name].expression in expressions for name in later)


def test_a_group_may_be_joined_by_more(load):
    search = load("search: {codebank: ['p0 * wi.z', published-2013, genbrdf-metal]}").search
    expressions = search.codebank_expressions()
    assert to_text(expressions[0]) == "p0 * wi.z"
    assert expressions[1:-1] == within_parameters(4, without={"genbrdf-metal", "genbrdf-dielectric"})
    assert expressions[-1] == CATALOGUE["genbrdf-metal"].expression


def within_parameters(count, without=()):
    """The catalogue's formulas of at most so many parameters."""
    formulas = (f for f in CATALOGUE.values() if f.name not in without)
    return tuple(f.expression for f in formulas if len(f.parameters) <= count)


def test_a_section_may_be_there_but_empty(load):
    assert load("budget:\nsearch:\nfit:\nscene:\n") == load("seed: 0")


def test_a_file_name_that_is_no_name_is_turned_into_one(load):
    assert load("seed: 0", name="..my run (2).yaml").name == "my-run-2-"


def test_paths_count_from_the_folder_of_the_file(tmp_path, monkeypatch):
    (tmp_path / "data").mkdir()
    (tmp_path / "runs").mkdir()
    (tmp_path / "data" / "steel.binary").touch()
    (tmp_path / "runs" / "a.yaml").write_text("materials: [../data/steel.binary]")
    monkeypatch.chdir(tmp_path)
    configuration = load_configuration(Path("runs/a.yaml"))
    assert configuration.folder == tmp_path / "runs"
    assert configuration.materials == ("../data/steel.binary",)


def test_files_need_not_be_there_when_a_finished_run_is_read(tmp_path):
    executor = "{kind: dask, scheduler: tls://a:1, tls: {ca: gone.pem, cert: gone.pem, key: gone.key}}"
    text = f"materials: [gone.binary]\nscene: {{light: gone.hdr}}\nexecutor: {executor}"
    with pytest.raises(GpsearchError, match="no file"):
        parse_configuration(text, source="run", folder=tmp_path)
    parse_configuration(text, source="run", folder=tmp_path, check_files=False)


def test_a_byte_order_mark_is_no_matter(load):
    assert load(b"\xef\xbb\xbfmaterials: [builtin:metal]").name == "quick"


def test_a_configuration_is_frozen_and_hashable(load):
    configuration = load("seed: 1")
    with pytest.raises(ValidationError):
        configuration.seed = 2
    assert hash(configuration) == hash(load("seed: 1"))


@dataclass(frozen=True)
class FleetSettings:
    """An executor that the configuration has no section for."""

    kind: ClassVar[str] = "fleet"
    ships: int = 3
    harbour: str | None = None

    def open(self, package: str | None) -> Executor:
        raise NotImplementedError


def test_an_executor_of_the_registry_needs_no_section_of_its_own(tmp_path):
    section = executor_section(FleetSettings)
    assert section(kind="fleet", ships=5).settings(tmp_path) == FleetSettings(5)
    with pytest.raises(ValidationError, match="boats"):
        section(kind="fleet", boats=5)
