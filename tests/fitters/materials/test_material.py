import dataclasses
import os

import numpy as np
import pytest

from fitters import grid
from fitters.errors import FittersError
from fitters.materials import load_material
from fitters.materials.material import from_samples


@pytest.fixture(scope="module")
def material():
    return from_samples("grey", np.full((3, *grid.SHAPE), 0.2), source="test", sha256="0")


def test_cells_below_the_horizon_are_not_valid(material):
    assert np.array_equal(material.valid, grid.above_horizon())
    assert not material.table[:, ~material.valid].any()


def test_its_arrays_cannot_be_changed(material):
    with pytest.raises(ValueError, match="read-only"):
        material.table[0, 0, 0, 0] = 1


def test_a_sample_too_large_for_float32_is_not_valid():
    samples = np.full((3, *grid.SHAPE), 0.2)
    samples[0, 0, 0, 0] = 1e300
    assert not from_samples("bright", samples, source="test", sha256="0").valid[0, 0, 0]


def poked(array, index, value):
    array = array.copy()
    array[index] = value
    return array


BROKEN = {
    "shape": (lambda m: {"table": m.table[:2]}, r"float32 \(3, 90, 90, 180\), not float32 \(2"),
    "type": (lambda m: {"table": m.table.astype(np.float64)}, "not float64"),
    "mask": (lambda m: {"valid": m.valid.astype(np.int8)}, "a mask is bool"),
    "nothing": (lambda m: {"valid": np.zeros_like(m.valid), "table": 0 * m.table}, "no cell is valid"),
    "negative": (lambda m: {"table": poked(m.table, (0, 0, 0, 0), -1)}, "negative, NaN or infinite"),
    "NaN": (lambda m: {"table": poked(m.table, (0, 0, 0, 0), np.nan)}, "negative, NaN or infinite"),
    "infinite": (lambda m: {"table": poked(m.table, (0, 0, 0, 0), np.inf)}, "negative, NaN or infinite"),
    "unmasked": (lambda m: {"valid": poked(m.valid, (0, 0, 0), False)}, "not 0 where a cell is not valid"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_material_that_breaks_its_invariants_cannot_be_made(material, case):
    change, message = BROKEN[case]
    with pytest.raises(FittersError, match=f"^grey: .*{message}"):
        dataclasses.replace(material, **change(material))


def test_a_relative_path_counts_from_the_base(tmp_path, simple_fields, write_bsdf, monkeypatch):
    path = write_bsdf(simple_fields)
    monkeypatch.chdir("/")
    assert load_material(path.name, base=tmp_path).name == "sample_rgb"


@pytest.mark.parametrize(
    ("reference", "message"),
    [
        ("builtin:mettal", "Did you mean builtin:metal\\?"),
        ("builtin:", "is no built-in material. There are metal,"),
        ("metal", "does not exist. Did you mean builtin:metal\\?"),
        ("stele.binary", "stele.binary does not exist. Did you mean steel.binary\\?"),
        (".", "is a folder: name one material file"),
        ("notes.txt", "notes.txt is no .binary file.*or builtin:metal"),
        ("nowhere/steel.binary", "cannot be listed either"),
        ("~nobody-here/steel.binary", "home folder of an unknown user"),
        ("a\0b.binary", "does not exist|cannot be used as a file name"),
        ("a\0b/c.binary", "does not exist|cannot be used as a file name"),
        ("pipe.binary", "not a regular file"),
        ("x" * 5000, "cannot be used as a file name|does not exist"),
        ("sparse.binary", "sparse.binary holds 1,073,741,824 bytes.*another kind of file"),
    ],
)
def test_a_reference_that_leads_nowhere_says_what_was_meant(tmp_path, reference, message):
    (tmp_path / "steel.binary").write_bytes(b"")
    (tmp_path / "notes.txt").write_text("x")
    os.mkfifo(tmp_path / "pipe.binary")
    with (tmp_path / "sparse.binary").open("wb") as file:
        file.truncate(1 << 30)
    with pytest.raises(FittersError, match=message):
        load_material(reference, base=tmp_path)


def test_an_unreadable_file_is_an_error_of_ours(tmp_path, monkeypatch):
    path = tmp_path / "steel.binary"
    path.write_bytes(b"x")

    def refuse(self):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(type(path), "read_bytes", refuse)
    with pytest.raises(FittersError, match=r"steel.binary cannot be read \(Permission denied\)"):
        load_material(path)
