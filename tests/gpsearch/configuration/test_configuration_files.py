"""Files that are no configuration at all: one line that says why, and never a traceback."""

import contextlib
import os
from pathlib import Path

import pytest
import yaml
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gpsearch.configuration import load_configuration, parse_configuration
from gpsearch.errors import GpsearchError

BOMB = "a: &a [x, x]\nb: &b [*a, *a]\nc: &c [*b, *b]\nmaterials: *c\n"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "quick.yaml: the file is empty"),
        (b"# nothing but a comment\n", "quick.yaml: the file is empty"),
        (b"- a\n- b\n", "quick.yaml:1: found a list; a configuration consists of lines `key: value`"),
        (b"hello", "quick.yaml:1: found 'hello'; a configuration"),
        (b"seed: 1\nscene: [1, 2\n", "quick.yaml:3: column 1: expected ',' or ']'"),
        (b"seed: 1\nsearch:\n\tislands: 2\n", "quick.yaml:3: column 1: found character '\\t'"),
        (b"seed: 1\nsearch:\n\tislands: 2\n", "indent with spaces, not tabs"),
        (b"seed: 1\nname: \xff\n", "quick.yaml:2: byte 14 is not UTF-8"),
        ("seed: 1".encode("utf-16"), "quick.yaml:1: byte 0 is not UTF-8"),
        (b"seed: 1\nname: a\x00b\n", "quick.yaml:2: character U+0000 has no place in YAML"),
        (b"seed: 1\n---\nseed: 2\n", "expected a single document"),
        (BOMB.encode(), "quick.yaml:2: column 8: the alias *a is refused"),
        (b"name: !!python/object/apply:os.system [ls]\n", "quick.yaml:1: column 7: a tag (! or !!) is refused"),
        (b"name: !!str a\n", "a tag (! or !!) is refused"),
        (b"[" * 5000, "nested more than 20 levels deep"),
        (b'name: "\\UFFFFFFFF"\n', "not valid YAML"),
        (b"seed: 1\nseed: 2\nmaterials: []", "quick.yaml:2: seed: the key is there already, in line 1"),
        (b"fit:\n  cells: 64\n  cells: 65\n", "quick.yaml:3: fit.cells: the key is there already, in line 2"),
        (b"1: 2\n", "quick.yaml:1: '1': a key is a text"),
        (b"? [a]\n: 2\n", "a key is a text"),
        (b'name: "\\ud800"\n', "half a character"),
        (b"seed: " + b"1" * 5000, "has too many digits"),
        (b"a: [" + b"1, " * 10_000 + b"]", "more than 10,000 keys and values"),
        (b"#" * 1_000_001, "quick.yaml: holds more than 1,000,000 bytes"),
    ],
)
def test_a_file_that_is_no_configuration(refusal, content, message):
    assert message in refusal(content)


def test_a_missing_file_suggests_one_beside_it(tmp_path):
    (tmp_path / "quick.yaml").touch()
    with pytest.raises(GpsearchError, match=r"quik\.yaml: no such file; did you mean quick\.yaml\?"):
        load_configuration(tmp_path / "quik.yaml")
    with pytest.raises(GpsearchError, match="no such file; its folder cannot be listed"):
        load_configuration(tmp_path / "none" / "quick.yaml")


def test_a_folder_a_pipe_and_impossible_names(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(GpsearchError, match="is a folder"):
        load_configuration(tmp_path)
    with pytest.raises(GpsearchError, match="is not a regular file"):
        load_configuration(tmp_path / "pipe")
    with pytest.raises(GpsearchError, match="is no path"):
        load_configuration(Path("a\0b"))
    with pytest.raises(GpsearchError, match="cannot be read"):
        load_configuration(Path("a" * 5000))


def refused_or_valid(text: str) -> None:
    """Fails by any exception but the one that a user may see."""
    with contextlib.suppress(GpsearchError):
        parse_configuration(text, source="a.yaml", folder=Path("/nonexistent"))


@settings(max_examples=300, deadline=None)
@given(st.binary(max_size=200))
def test_random_bytes_are_refused_in_words(tmp_path_factory, content):
    path = tmp_path_factory.getbasetemp() / "fuzz.yaml"
    path.write_bytes(content)
    with pytest.raises(GpsearchError):
        load_configuration(path)


@settings(max_examples=500, deadline=None)
@given(st.text(st.sampled_from("aseed0189:.-+_eExob#!&*?|>%@`'\"\\[]{},<= \n\t~uU\u2028\x85é"), max_size=60))
@example("!<")
@example("%YAML 1.9999999999999999999")
@example("? ? ?")
@example("a: 0b_")
@example("a: 2024-13-45")
@example("<<: 3")
@example("=: =")
def test_random_yaml_is_refused_in_words(text):
    refused_or_valid(text)


NAMES = """name seed materials scene light metric executor kind scheduler workers budget generations minutes search
start codebank bounds edits swap fit tolerance baselines tls ca x"""
keys = st.sampled_from(NAMES.split()) | st.text(max_size=5)
values = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.sampled_from([10**400, -(10**30), 1, 2])
    | st.floats()
    | st.text(max_size=10)
    | st.dates()
    | st.binary(max_size=3)
    | st.sampled_from(["dask", "local", "ggx", "builtin:metal", "p0 * wi.z", "~nobody/x", "1e400", "1e-6"]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(keys, inner, max_size=4),
    max_leaves=8,
)


@settings(max_examples=400, deadline=None)
@given(st.dictionaries(keys, values, max_size=6))
def test_random_values_are_refused_in_words(tree):
    dumped = yaml.safe_dump({"materials": ["builtin:metal"], **tree})
    refused_or_valid(dumped)
