"""What a user's word for a material means beside a run."""

import pytest

from gpsearch.errors import GpsearchError
from gpsearch.judging.materials import materials_of_run, named_material, require_different_names
from tests.gpsearch.small import small


@pytest.fixture
def configuration(tmp_path, monkeypatch):
    """Files in `data` of a folder; the working folder is `data`."""
    (tmp_path / "data").mkdir()
    for name in ("steel.binary", "gold.bsdf", "brass.bsdf", "fabric.binary"):
        (tmp_path / "data" / name).touch()
    monkeypatch.chdir(tmp_path / "data")
    tests = ["data/gold.bsdf", "builtin:fabric"]
    return small(tmp_path, materials=["builtin:metal", "data/steel.binary"], test_materials=tests)


@pytest.mark.parametrize(
    ("text", "name", "role"),
    [
        ("metal", "metal", "training"),
        ("builtin:metal", "metal", "training"),
        ("steel", "steel", "training"),
        ("data/steel.binary", "steel", "training"),
        ("steel.binary", "steel", "training"),
        ("../data/steel.binary", "steel", "training"),
        ("gold", "gold", "test"),
        ("gold.bsdf", "gold", "test"),
        ("fabric", "fabric", "test"),
        ("brass.bsdf", "brass", "new"),
        ("builtin:rough-plastic", "rough-plastic", "new"),
    ],
)
def test_names_references_and_paths_are_found(configuration, text, name, role):
    found = named_material(text, configuration)
    assert (found.name, found.role) == (name, role)
    if "." in text:
        assert found.reference == str(configuration.folder / "data" / f"{name}.{text.rpartition('.')[2]}")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "silver",
            "no such file, and the run has models of metal, steel, gold, fabric; name one of these, a file",
        ),
        ("silver.bsdf", "--material silver.bsdf: there is no such file"),
        ("fabric.binary", "fabric.binary is called as builtin:fabric is; name each once"),
    ],
)
def test_what_is_neither_is_refused(configuration, text, words):
    with pytest.raises(GpsearchError, match=words):
        named_material(text, configuration)


def test_one_material_twice_is_refused(configuration):
    gold = named_material("gold", configuration)
    with pytest.raises(GpsearchError, match="named twice") as caught:
        require_different_names([gold, named_material("gold.bsdf", configuration)])
    assert "gold.bsdf" in str(caught.value)


def test_the_materials_of_a_run_are_those_of_the_search_and_then_the_tests(configuration):
    assert [(one.name, one.role) for one in materials_of_run(configuration)] == [
        ("metal", "training"),
        ("steel", "training"),
        ("gold", "test"),
        ("fabric", "test"),
    ]
