"""What problem a run is about: told by content, not by names."""

from dataclasses import replace
from pathlib import Path

import pytest

from fitters.materials import load_material
from fitters.materials.merl import write_merl
from gpsearch.errors import GpsearchError
from gpsearch.judging.contenders import load_contenders
from gpsearch.run import Generation, WritableStore, load_run
from gpsearch.run.identity import ProblemIdentity, identify, identify_tests
from tests.gpsearch.entries import result
from tests.gpsearch.small import make_store, small, writing

METAL = {"builtin:metal": "1", "a/fabric.binary": "2"}
KNOWN = ProblemIdentity(METAL, "light", "light")


def test_neither_names_nor_the_order_of_materials_matter():
    renamed = ProblemIdentity({"x.binary": "2", "y.binary": "1"}, "light", "light")
    assert renamed.sha256 == KNOWN.sha256
    assert KNOWN.differences(renamed) == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"metric": "compressive"}, ["metric: compressive instead of light"]),
        ({"light": "other"}, ["scene: another light or geometry"]),
        ({"materials": METAL | {"a/fabric.binary": "3"}}, ["materials: fabric.binary instead of fabric.binary"]),
        ({"materials": {"builtin:metal": "1"}}, ["materials: none instead of fabric.binary"]),
    ],
)
def test_whatever_changes_an_error_makes_another_problem(change, words):
    other = replace(KNOWN, **change)
    assert other.sha256 != KNOWN.sha256
    assert KNOWN.differences(other) == words


def identified(folder: Path, **changes: object) -> str | None:
    """The digest of a run that was launched with these changes to its configuration."""
    configuration = small(folder, **changes)
    run = make_store(folder / f"run{len(list(folder.iterdir()))}", configuration.text())
    with writing(run) as store:
        identify(store, configuration)
        identify_tests(store, configuration)
        identity = ProblemIdentity.of(store, configuration)
    assert identity is not None
    return identity.sha256


def test_the_scene_and_the_metric_are_part_of_it_and_the_seed_is_not(tmp_path):
    digest = identified(tmp_path)
    assert identified(tmp_path, seed=6, test_materials=["builtin:fabric"]) == digest
    others = [
        identified(tmp_path, scene={"rotation": 90.0}),
        identified(tmp_path, metric="compressive"),
        identified(tmp_path, materials=["builtin:fabric"]),
    ]
    assert len({digest, *others}) == 4


def begun(store: WritableStore) -> None:
    with store.transaction():
        store.save_generation(Generation(0, 1, 16, 16, 0, 1, 0.5, 2.0, {}))


def write_file(folder: Path, name: str) -> None:
    """Writes a built-in material as a file."""
    material = load_material(f"builtin:{name}")
    write_merl(folder / "x.binary", material.table, material.valid)


@pytest.fixture
def metal(tmp_path) -> Path:
    """A configuration's folder with a material file."""
    write_file(tmp_path, "metal")
    return tmp_path


def test_a_run_does_not_go_on_where_a_file_has_another_content(metal):
    configuration = small(metal, materials=["x.binary"])
    with writing(make_store(metal / "run", configuration.text())) as store:
        identify(store, configuration)
        write_file(metal, "fabric")
        identify(store, configuration)  # nothing was found yet
        begun(store)
        write_file(metal, "metal")
        with pytest.raises(GpsearchError, match=r"this run was searched on another content of x\.binary"):
            identify(store, configuration)


def test_models_are_not_loaded_for_a_file_that_has_another_content(metal):
    configuration = small(metal, materials=["x.binary"])
    with writing(make_store(metal / "run", configuration.text())) as store:
        identify(store, configuration)
    loaded = load_run(metal / "run")
    assert load_contenders(loaded, [load_material("x.binary", base=metal)]) == []
    write_file(metal, "fabric")
    with pytest.raises(GpsearchError, match="x has another content than when the run was searched"):
        load_contenders(loaded, [load_material("x.binary", base=metal)])
    assert load_contenders(result(), [load_material("x.binary", base=metal)]) == []


def test_a_run_of_a_version_that_stored_no_hashes_has_none(tmp_path):
    configuration = small(tmp_path)
    run = make_store(tmp_path / "run", configuration.text())
    assert load_run(run).run.problem_sha256 is None
    with writing(run) as store:
        begun(store)
        with pytest.raises(GpsearchError, match="this run was searched under another light table"):
            identify(store, configuration)
