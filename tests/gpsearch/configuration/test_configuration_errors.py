"""What a user reads about a key or a value that is wrong."""

import os

import pytest

from gpsearch.configuration import parse_configuration
from gpsearch.errors import GpsearchError
from tests.unprivileged import public_folder, unprivileged


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("search:\n  tournamnt: 8", "quick.yaml:2: search.tournamnt: no such key; did you mean tournament?"),
        ("budgit: 8", "quick.yaml:1: budgit: no such key; did you mean budget?"),
        ("search: {generations: 3}", "search.generations: no such key; did you mean budget.generations?"),
        ("executor: {kind: dask, wrokers: 3}", "executor.wrokers: no such key; did you mean workers?"),
        ("executor: {kind: local, workers: 3}", "executor.workers: no such key; there is kind"),
        ("fit: {zzz: 3}", "fit.zzz: no such key; there are cells, confirm_cells, starts"),
        ("folder: /tmp", "folder: no such key; there are name, seed"),
        ("seed: -1", "seed: found -1; allowed: a whole number from 0 up"),
        ("seed: true", "seed: found true; allowed: a whole number"),
        ("seed: 1.5", "seed: found 1.5; allowed: a whole number"),
        ("seed: 9223372036854775808", "seed: found 9223372036854775808; allowed"),
        ("name: 42", "name: found 42; allowed: letters, digits, '-', '_' and '.'"),
        ("name: a/b", "name: found 'a/b'; allowed: letters"),
        ("name: ..", "name: found '..'; allowed: letters"),
        ("name: 'a\n\n'", "name: found 'a\\n'; allowed: letters"),
        ("metric: lihgt", "metric: found 'lihgt'; did you mean light? allowed: light, compressive, light-sum"),
        ("scene: {rotation: .nan}", "scene.rotation: found nan; allowed: a finite number"),
        ("scene: {resolution: 1025}", "scene.resolution: found 1025; allowed: a whole number from 1 to 1024"),
        ("scene: {light: studoi}", "did you mean studio?"),
        ("scene: {geometry: teapot}", "scene.geometry: no file teapot; the built-in geometry is sphere"),
        ("scene: {shape: lid}", "scene.shape: found 'lid', which is for a scene file; remove it or name one"),
        ("scene: {shadows: false}", "scene.shadows: found false, which is for a scene file"),
        ("scene: {shadows: 1}", "scene.shadows: found 1; allowed: true or false"),
        ("executor: threads", "executor: found {kind: 'threads'}; allowed: local, dask, or {kind: dask"),
        ("executor: {}", "executor: is missing; allowed: local"),
        ("executor: 3", "executor: found 3; allowed: local"),
        (
            "executor: {kind: dask, scheduler: somewhere}",
            "executor.scheduler: found 'somewhere'; allowed: an",
        ),
        ("executor: {kind: dask, workers: 0}", "executor.workers: found 0; allowed: a whole number from 1"),
        ("budget: {minutes: 0}", "budget.minutes: found 0; allowed: a finite number greater than 0, or null"),
        ("budget: {candidates: 0}", "budget.candidates: found 0; allowed: a whole number from 1 up, or null"),
        ("budget: {generations: null}", "budget: every limit is null"),
        ("search: 3", "search: found 3; allowed: a mapping of the keys parameters, max_nodes"),
        ("search: {island_size: 7}", "search.island_size: found 7; allowed: an even number"),
        ("search: {island_size: 2}", "search.island_size: found 2; allowed: a whole number from 4"),
        (
            "search: {island_size: 8, migrants: 8}",
            "search.migrants: found 8; allowed: fewer than",
        ),
        ("search: {max_nodes: 4}", "search.max_nodes: found 4; allowed: a whole number from 5 to 1000"),
        ("search: {parameters: 9}", "search.parameters: found 9; allowed: a whole number from 1 to 8"),
        ("search: {bounds: [2, 1]}", "search.bounds: found [2.0, 1.0]; allowed: [low, high] with low < high"),
        (
            "search: {codebank: published-2012}",
            "search.codebank[0]: 'published-2012' is no group of the catalogue",
        ),
        ("search: {bounds: [2]}", "search.bounds[1]: is missing; allowed: two finite numbers [low, high]"),
        ("search: {bounds: [0, .inf]}", "search.bounds[1]: found inf; allowed: two finite numbers"),
        ("search: {edits: {swap: -1}}", "search.edits.swap: found -1; allowed: a finite number of at least 0"),
        ("search: {edits: {swap: 0, insert: 0, replace: 0, delete: 0}}", "search.edits: every frequency is 0"),
        ("search: {start: []}", "search.start: found []; allowed: at least one"),
        ("fit: {cells: 63}", "fit.cells: found 63; allowed: a whole number from 64"),
        ("fit: {tolerance: 0}", "fit.tolerance: found 0; allowed: a finite number greater than 0"),
        ("baselines: [gxx]", "baselines[0]: found 'gxx'; did you mean ggx? allowed: lambert"),
        (
            "baselines: [npf-independent]",
            "found 'npf-independent'; did you mean npf-independent-g? allowed: lambert",
        ),
        ("baselines: [ggx, bivariate, ggx]", "baselines[2]: 'ggx' is baselines[0] again; name each baseline once"),
        ("materials: []", "materials: found []; allowed: a list of at least one"),
        ("materials: builtin:metal", "materials: found 'builtin:metal'; allowed: a list"),
        (
            "materials: [builtin:metall]",
            "materials[0]: no built-in material 'builtin:metall'; did you mean",
        ),
        ("scene: {rotation: 1:30}", "scene.rotation: '1:30' is read in another base; write it in decimals"),
        ("seed: 010", "seed: '010' is read in another base"),
    ],
)
def test_a_problem_names_the_key_what_was_found_and_what_is_allowed(refusal, text, message):
    found = refusal(text)
    assert message in found
    assert "\n" not in found


def test_a_file_without_materials(refusal):
    assert refusal(b"seed: 1").startswith("quick.yaml:1: materials: is missing; allowed: a list of at least one")


def test_every_problem_is_listed_with_its_line(refusal):
    text = "seed: -1\nsearch:\n  start:\n    - ggx\n    - gxx\n  islands: 0\n  isles: 1\nmetric: x\n"
    lines = refusal(text).splitlines()
    assert [line.split(": ")[:2] for line in lines] == [
        ["quick.yaml:1", "seed"],
        ["quick.yaml:5", "search.start[1]"],
        ["quick.yaml:6", "search.islands"],
        ["quick.yaml:7", "search.isles"],
        ["quick.yaml:8", "metric"],
    ]


def test_a_long_list_of_problems_is_cut(refusal):
    lines = refusal("\n".join(f"key{i}: 1" for i in range(2000))).splitlines()
    assert len(lines) == 101
    assert lines[-1] == "quick.yaml: 1900 more problems"


def test_an_entry_that_is_neither_name_nor_expression(refusal):
    found = refusal("search:\n  start:\n    - cook-torance")
    assert "quick.yaml:3: search.start[0]: 'cook-torance' is no catalogue name" in found
    assert "did you mean cook-torrance?" in found
    assert "no expression (expected a function" in found


def test_an_expression_torn_by_its_comma(refusal):
    assert "needs quotes" in refusal("search: {start: [max(p0, p1)]}")


def test_parameters_beyond_the_search(refusal):
    assert "search.start[0]: 'p4 * wi.z' uses p4, but search.parameters is 4: p0 to p3 may occur" in refusal(
        "search: {start: p4 * wi.z}"
    )
    assert "search.codebank[1]: 'ggx' uses p2, p3" in refusal(
        "search: {parameters: 2, start: lambert, codebank: [lambert, ggx]}"
    )
    assert "search.start[0]: 'cook-torrance' uses p1, p2, p3" in refusal("search: {parameters: 1}")


def test_a_start_larger_than_the_search_allows(refusal, load):
    text = "search: {max_nodes: 5, start: [%s]}"
    load(text % "p0 * wi.z + 1")
    assert "has 7 nodes, but search.max_nodes is 5" in refusal(text % "p0 * wi.z + 1 * 2")


def test_missing_material_and_light_files(refusal, tmp_path):
    (tmp_path / "steel.binary").touch()
    (tmp_path / "sky.exr").touch()
    found = refusal("materials: [steel.bnary, nowhere/a.bsdf, .]\nscene:\n  light: sky.exx").splitlines()
    assert found[0] == "quick.yaml:1: materials[0]: no file steel.bnary; did you mean steel.binary?"
    assert "materials[1]: no file nowhere/a.bsdf; its folder cannot be listed" in found[1]
    assert "materials[2]: " in found[2]
    assert "is a folder" in found[2]
    assert found[3] == "quick.yaml:3: scene.light: no file sky.exx; did you mean sky.exr?"


def test_a_missing_file_is_named_by_its_whole_path(load, tmp_path):
    with pytest.raises(ValueError, match=str(tmp_path / "data" / "a.bsdf")):
        load("materials: [data/a.bsdf]")


def test_a_file_of_another_kind(refusal, tmp_path):
    (tmp_path / "steel.png").touch()
    assert "materials[0]: 'steel.png' does not end in .binary or .bsdf" in refusal("materials: [steel.png]")
    assert "scene.light: 'steel.png' does not end in .hdr or .exr" in refusal("scene: {light: steel.png}")


def test_a_pipe_is_not_waited_for(refusal, tmp_path):
    os.mkfifo(tmp_path / "a.bsdf")
    assert "is not a regular file" in refusal("materials: [a.bsdf]")


def test_a_material_given_twice(refusal, tmp_path):
    (tmp_path / "a.bsdf").touch()
    (tmp_path / "b.bsdf").symlink_to("a.bsdf")
    again = "is materials[0] again; name each material once"
    assert f"quick.yaml:3: materials[1]: './a.bsdf' {again}" in refusal("materials:\n- a.bsdf\n- ./a.bsdf")
    assert f"'b.bsdf' {again}" in refusal("materials: [a.bsdf, b.bsdf]")
    assert f"'builtin:metal' {again}" in refusal("materials: [builtin:metal, builtin:metal]")


def test_a_test_material_is_none_that_the_search_is_on(refusal, tmp_path):
    (tmp_path / "a.bsdf").touch()
    (tmp_path / "b.bsdf").symlink_to("a.bsdf")
    text = "materials: [builtin:metal, a.bsdf]\ntest_materials:\n- builtin:fabric\n- %s"
    once = "name each material once"
    assert f"quick.yaml:4: test_materials[1]: './a.bsdf' is materials[1] again; {once}" in refusal(
        text % "./a.bsdf"
    )
    assert f"'b.bsdf' is materials[1] again; {once}" in refusal(text % "b.bsdf")
    assert f"'builtin:metal' is materials[0] again; {once}" in refusal(text % "builtin:metal")
    assert f"'builtin:fabric' is test_materials[0] again; {once}" in refusal(text % "builtin:fabric")
    assert "test_materials[1]: no built-in material 'builtin:metl'; did you mean" in refusal(text % "builtin:metl")
    assert "test_materials[1]: no file" in refusal(text % "c.bsdf")
    assert "test_materials: found 'builtin:metal'; allowed: a list of" in refusal("test_materials: builtin:metal")


def test_no_two_materials_of_a_run_have_one_name(refusal, tmp_path):
    (tmp_path / "more").mkdir()
    for file in ("a.bsdf", "a.binary", "metal.binary", "more/a.bsdf"):
        (tmp_path / file).touch()
    called = "test_materials[0]: 'more/a.bsdf' is called 'a' as materials[0] is; rename one of the files"
    assert called in refusal("materials: [a.bsdf]\ntest_materials: [more/a.bsdf]")
    assert "materials[1]: 'a.binary' is called 'a'" in refusal("materials: [a.bsdf, a.binary]")
    assert "'metal.binary' is called 'metal' as materials[0] is" in refusal(
        "materials: [builtin:metal]\ntest_materials: [metal.binary]"
    )


TLS = "executor:\n  kind: dask\n  scheduler: %s\n  tls: {ca: ca.pem, cert: cert.pem, key: key.pem}"


@pytest.mark.usefixtures("pem_files")
def test_tls_and_the_schedulers_address_go_together(refusal, load):
    load(TLS % "tls://host:8786")
    assert refusal(TLS % "tcp://host:8786") == (
        "quick.yaml:4: executor.tls: needs a tls:// scheduler, found 'tcp://host:8786'; write tls:// or remove tls"
    )
    assert "executor.tls: needs a tls:// scheduler, found 'host:8786'" in refusal(TLS % "host:8786")
    assert refusal(TLS % "null") == (
        "quick.yaml:4: executor.tls: is for a running scheduler, processes of this machine need none; remove it"
    )
    assert refusal("executor: {kind: dask, scheduler: tls://host:8786}") == (
        "quick.yaml:1: executor.tls: is missing, which 'tls://host:8786' needs; "
        "allowed: a mapping of the keys ca, cert, key"
    )
    assert [line.split(": ")[1] for line in refusal(TLS % "nowhere").splitlines()] == ["executor.scheduler"]


@pytest.mark.usefixtures("pem_files")
def test_the_files_of_tls(refusal, tmp_path):
    text = TLS % "tls://host:8786"
    assert refusal(text.replace("ca.pem", "ka.pem")) == (
        "quick.yaml:4: executor.tls.ca: no file ka.pem; did you mean ca.pem?"
    )
    assert "executor.tls.key: no file nowhere/key; its folder" in refusal(text.replace("key.pem", "nowhere/key"))
    assert "executor.tls.cert: " in (found := refusal(text.replace("cert.pem", ".")))
    assert "is a folder; name a file" in found
    assert refusal(text.replace("key.pem", "cert.pem")) == (
        "quick.yaml:4: executor.tls.key: cert.pem has no line -----BEGIN PRIVATE KEY-----; name a file in PEM form"
    )
    (tmp_path / "ca.pem").write_bytes(b"\x30\x82\xff")
    assert "executor.tls.ca: ca.pem has no line -----BEGIN CERTIFICATE-----" in refusal(text)


def test_a_key_that_may_not_be_read():
    with public_folder() as folder:
        (folder / "key.pem").touch(mode=0)
        text = "executor: {kind: dask, scheduler: tls://a:1, tls: {key: key.pem}}"
        with unprivileged(), pytest.raises(GpsearchError) as caught:
            parse_configuration(text, source="quick.yaml", folder=folder)
    assert f"executor.tls.key: {folder}/key.pem cannot be read (Permission denied); check the path" in str(
        caught.value
    )


@pytest.mark.parametrize(
    ("tls", "message"),
    [
        ("{ca: a, cert: b}", "executor.tls.key: is missing; allowed: the path of a private key's PEM file"),
        ("{ca: 3}", "executor.tls.ca: found 3; allowed: the path of a certificate authority's PEM file"),
        ("{ca: a, cart: b}", "executor.tls.cart: no such key; did you mean cert?"),
        ("yes", "executor.tls: found true; allowed: a mapping of the keys ca, cert, key"),
        ("", "executor.tls: is missing, which 'tls://a:1' needs"),
    ],
)
def test_keys_of_tls(refusal, tls, message):
    assert message in refusal(f"executor:\n  kind: dask\n  scheduler: tls://a:1\n  tls: {tls}")
