"""The resolved text of a configuration, and how two configurations compare."""

import re
from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from gpsearch import configuration
from gpsearch.configuration import Configuration, loading, parse_configuration

TLS = "executor: {kind: dask, scheduler: tls://a:1, tls: {ca: ca.pem, cert: cert.pem, key: key.pem}}"

positive = st.floats(1e-300, 1e300)
wholes = st.integers(1, 10**4)
files = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0/"), max_size=20).map(
    lambda stem: f"{stem}x.bsdf"
)
trees = st.fixed_dictionaries(
    {"materials": st.lists(files, min_size=1, max_size=3, unique=True)},
    optional={
        "name": st.from_regex(r"[A-Za-z0-9_][A-Za-z0-9._-]{0,20}", fullmatch=True),
        "seed": st.integers(0, 2**63 - 1),
        "test_materials": st.lists(files.map(lambda file: f"{file}.bsdf"), max_size=3, unique=True),
        "scene": st.fixed_dictionaries({}, optional={"rotation": st.floats(-1e300, 1e300)}),
        "executor": st.sampled_from(["local", "dask", {"kind": "dask", "scheduler": "tls://[::1]:8786"}])
        | st.fixed_dictionaries(
            {
                "kind": st.just("dask"),
                "scheduler": st.just("tls://a:1"),
                "tls": st.fixed_dictionaries({"ca": files, "cert": files, "key": files}),
            }
        ),
        "budget": st.fixed_dictionaries({}, optional={"minutes": positive, "candidates": wholes}),
        "search": st.fixed_dictionaries(
            {},
            optional={
                "start": st.sampled_from(["ggx", ["p0+p1*(wh.z-1.50)", "phong"], " p0 /pi"]),
                "bounds": st.tuples(st.floats(-1e300, -1e-300), positive).map(list),
                "edits": st.fixed_dictionaries({"swap": positive}),
            },
        ),
        "fit": st.fixed_dictionaries({}, optional={"tolerance": positive, "starts": wholes}),
    },
)


@settings(max_examples=60, deadline=None)
@given(trees)
def test_the_resolved_text_loads_back_to_an_equal_configuration(tmp_path_factory, tree):
    folder = tmp_path_factory.getbasetemp()

    def read(text: str) -> Configuration:
        return parse_configuration(text, source="a.yaml", folder=folder, check_files=False)

    configuration = read(yaml.safe_dump(tree))
    again = read(configuration.text())
    assert again == configuration
    assert again.text() == configuration.text()
    assert again.sha256 == configuration.sha256
    assert not again.differences(configuration)


def test_the_hash_is_of_all_that_decides_what_is_found(tmp_path):
    def sha256(**changes) -> str:
        text = yaml.safe_dump({"materials": ["x.bsdf"], **changes})
        return parse_configuration(text, source="a.yaml", folder=tmp_path, check_files=False).sha256

    assert sha256() == sha256(executor="dask") == sha256(executor={"kind": "dask", "scheduler": "tcp://a:1"})
    assert sha256() == sha256(**yaml.safe_load(TLS))
    assert sha256() == sha256(test_materials=["y.bsdf"])
    assert len({sha256(), sha256(seed=1), sha256(metric="compressive"), sha256(search={"islands": 3})}) == 4


def test_the_resolved_text_has_every_key_and_not_the_folder(load, tmp_path):
    tree = yaml.safe_load(load("seed: 1").text())
    assert list(tree) == list(Configuration.model_fields)
    assert list(tree["search"]) == list(Configuration.model_fields["search"].annotation.model_fields)
    assert str(tmp_path) not in load("seed: 1").text()


def test_the_order_of_keys_and_the_spelling_of_expressions_do_not_matter(load):
    first = load("seed: 1\nsearch: {islands: 2, start: 'p0*wi.z'}")
    second = load("search: {start: ['p0  * (wi.z)'], islands: 2}\nseed: 1")
    assert first.text() == second.text()
    assert first == second


def test_differences_name_the_key_and_both_values(load):
    here = load("seed: 1\nsearch: {islands: 2}\nexecutor: {kind: dask, workers: 3}")
    there = load("search: {bounds: [0, 1]}")
    found = {d.key: (d.here, d.there) for d in here.differences(there)}
    assert found == {
        "seed": (1, 0),
        "executor.kind": ("dask", "local"),
        "executor.workers": (3, None),
        "executor.wait_seconds": (60.0, None),
        "executor.hang_seconds": (60.0, None),
        "search.islands": (2, 4),
        "search.bounds": ((1e-6, 1e5), (0.0, 1.0)),
    }
    assert str(here.differences(there)[0]) == "seed: 1 instead of 0"


@pytest.mark.parametrize(
    ("new", "old"),
    [
        ("seed: 0", "seed: 0"),
        ("budget: {generations: 101}", "budget: {generations: 100}"),
        ("budget: {generations: null, minutes: 5}", "budget: {minutes: 5}"),
        ("budget: {minutes: 5.5, candidates: 9}", "budget: {minutes: 5, candidates: 8}"),
        ("executor: dask", "executor: local"),
        ("executor: local\nbudget: {generations: 200}", "executor: {kind: dask, workers: 3}"),
        (TLS, "executor: local"),
        ("executor: local", TLS),
        (TLS, TLS.replace("cert.pem", "ca.pem")),
        ("test_materials: [builtin:fabric]", "seed: 0"),
        ("seed: 0", "test_materials: [builtin:fabric]"),
        ("test_materials: [builtin:fabric]", "test_materials: [builtin:rough-plastic, builtin:glossy-plastic]"),
    ],
)
@pytest.mark.usefixtures("pem_files")
def test_larger_budgets_other_executors_and_other_test_materials_extend_a_run(load, new, old):
    assert load(new).extends(load(old))


@pytest.mark.parametrize(
    ("new", "old", "keys"),
    [
        ("budget: {generations: 99}", "seed: 0", ["budget.generations"]),
        ("budget: {minutes: 5}", "seed: 0", ["budget.minutes"]),
        ("seed: 1", "seed: 0", ["seed"]),
        ("name: b", "name: a", ["name"]),
        ("materials: [builtin:fabric]", "materials: [builtin:metal]", ["materials"]),
        ("fit: {cells: 100}\nbudget: {generations: 200}", "search: {islands: 2}", ["search.islands", "fit.cells"]),
    ],
)
def test_anything_else_conflicts_by_name(load, new, old, keys):
    assert not load(new).extends(load(old))
    assert [difference.key for difference in load(new).conflicts(load(old))] == keys


def test_the_page_of_the_configuration_has_every_key():
    page = (Path(configuration.__file__).parent / "README.md").read_text()
    keys = {key for path in loading.ALLOWED for key in path if path[:2] != ("executor", key)}
    assert sorted(key for key in keys if not re.search(rf"[`.{{ ]{key}\b", page)) == []
