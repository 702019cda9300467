import importlib.util
import struct

import numpy as np
import pytest

from fitters import grid
from fitters.errors import FittersError
from fitters.materials import load_material, merl
from fitters.materials.merl import FILE_BYTES, SCALE, write_merl


@pytest.fixture
def measured():
    """A table (3, 90, 90, 180) of a colourful material, and a mask without the cells below the horizon."""
    table = np.random.default_rng(1).uniform(0.01, 2, (3, *grid.SHAPE)).astype(np.float32)
    return table, grid.above_horizon().copy()


@pytest.fixture
def path(tmp_path):
    return tmp_path / "steel.binary"


def planes(path):
    """The stored numbers (3, 90, 90, 180) of a file, writable in place."""
    return np.memmap(path, "<f8", "r+", 12, (3, *grid.SHAPE))


def test_what_is_written_is_read_again(path, measured):
    table, valid = measured
    write_merl(path, table, valid)
    material = load_material(path)
    np.testing.assert_allclose(material.table, np.where(valid, table, 0), rtol=1e-6)
    assert np.array_equal(material.valid, valid)
    assert material.negative == (0, 0, 0)
    assert material.name == "steel"
    assert material.source.startswith("MERL")


def test_follows_the_published_layout(path, measured):
    write_merl(path, *measured)
    content = path.read_bytes()
    assert len(content) == 34_992_012
    assert struct.unpack_from("<3i", content) == (90, 90, 180)
    green_at_3_4_5 = struct.unpack_from("<d", content, 12 + 8 * (90 * 90 * 180 + 5 + 180 * (4 + 90 * 3)))[0]
    assert green_at_3_4_5 * 1.15 / 1500 == pytest.approx(measured[0][1, 3, 4, 5], rel=1e-6)


@pytest.mark.parametrize("name", ["gold-paint", "pure-rubber"])
def test_reads_the_surrogates_that_another_program_wrote(shared, tmp_path, name):
    spec = importlib.util.spec_from_file_location("merl_surrogate", shared / "tools/merl_surrogate.py")
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    weights = dict(np.load(shared / "data/merl/nbrdf.npz"))
    expected = tool.table(weights, [str(n) for n in weights["names"]].index(name))
    tool.write(tmp_path / f"{name}.binary", expected)
    material = load_material(tmp_path / f"{name}.binary")
    assert np.array_equal(material.valid, ~np.isnan(expected[0]))
    np.testing.assert_allclose(material.table, np.nan_to_num(expected), rtol=1e-6)
    assert "not one of the released files" in material.source


def test_unusable_cells_are_left_out_and_single_negative_channels_are_counted(path, measured):
    table, valid = measured
    write_merl(path, table, valid)
    stored, lit = planes(path), np.argwhere(valid)
    nan, missing, infinite, dark_blue = (tuple(cell) for cell in lit[[10, 1000, 100_000, 700_000]])
    stored[(1, *nan)] = np.nan
    stored[(0, *infinite)] = np.inf
    for channel in range(3):
        stored[(channel, *missing)] = -0.3
    stored[(2, *dark_blue)] = -0.3
    stored.flush()
    material = load_material(path)
    assert valid.sum() - material.valid.sum() == 3
    for cell in (nan, missing, infinite):
        assert not material.valid[cell]
        assert not material.table[(slice(None), *cell)].any()
    assert material.valid[dark_blue]
    assert material.table[(2, *dark_blue)] == 0
    assert material.negative == (0, 0, 1 / material.valid.sum())


def test_a_released_file_is_recognised_by_its_content(path, measured, monkeypatch):
    assert merl.genuine_merl_name("0" * 64) is None
    assert len(merl._genuine()) == 100
    chrome = next(sha256 for sha256, name in merl._genuine().items() if name == "chrome.binary")
    assert merl.genuine_merl_name(chrome) == "chrome.binary"

    write_merl(path, *measured)
    sha256 = load_material(path).sha256
    monkeypatch.setattr(merl, "_genuine", lambda: {sha256: "chrome.binary"})
    assert load_material(path).source == "MERL, genuine chrome.binary"


def header(*sizes):
    return struct.pack("<3i", *sizes)


WRONG = {
    "empty": (b"", r"^steel.binary is empty"),
    "few bytes": (
        header(90, 90, 180)[:7],
        r"holds 7 bytes, a MERL file has 34,992,012: the download was cut short",
    ),
    "truncated": (
        header(90, 90, 180) + bytes(34_990_988),
        r"^steel.binary holds 34,991,000 bytes.*Fetch it again",
    ),
    "too long": (header(90, 90, 180) + bytes(FILE_BYTES), r"holds 34,992,024 bytes.*something was appended"),
    "full azimuth": (
        header(90, 90, 360) + bytes(100),
        r"begins with 90, 90, 360, a MERL file with 90, 90, 180",
    ),
    "big-endian": (struct.pack(">3i", 90, 90, 180) + bytes(100), r"begins with 1509949440"),
    "web page": (b"<!DOCTYPE html><html>", r"another kind of file"),
    "two letters": (b"hi", r"begins with only 2 bytes"),
    "NaN-filled": (
        header(90, 90, 180) + np.full(3 * grid.CELLS, np.nan).tobytes(),
        r"^steel: none of its 1,458,000 cells is usable.*1,096,216 are NaN",
    ),
    "all missing": (header(90, 90, 180) + np.full(3 * grid.CELLS, -1.0).tobytes(), r"none of its .*negative"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_file_is_refused_with_what_to_do(path, case):
    content, message = WRONG[case]
    path.write_bytes(content)
    with pytest.raises(FittersError, match=message):
        load_material(path)


def test_only_whole_tables_are_written(path, measured):
    with pytest.raises(FittersError, match=r"not \(2, 90, 90, 180\)"):
        write_merl(path, measured[0][:2], measured[1])


def test_the_scale_is_the_published_one():
    np.testing.assert_allclose(SCALE, [1 / 1500, 1.15 / 1500, 1.66 / 1500])
