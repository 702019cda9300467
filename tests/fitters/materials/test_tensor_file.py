import struct

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fitters.errors import FittersError
from fitters.materials.rgl import RglMaterial
from fitters.materials.tensor_file import parse

FIELDS = {
    "letters": np.frombuffer(b"abc", np.uint8),
    "numbers": np.arange(6, dtype=np.float64).reshape(1, 2, 3),
    "nothing": np.zeros((0, 4), np.float32),
    "scalar": np.array(7, np.uint64),
}


def test_reads_every_field_with_its_shape_and_type(tensor_bytes):
    fields = parse(tensor_bytes(FIELDS), "a.bsdf")
    assert list(fields) == list(FIELDS)
    for name, array in FIELDS.items():
        assert fields[name].dtype == array.dtype
        np.testing.assert_array_equal(fields[name], array)


def test_reads_what_mitsuba_writes(tmp_path):
    tensor_io = pytest.importorskip("mitsuba.python.tensor_io", reason="Mitsuba 3 writes the reference file")
    tensor_io.write(str(tmp_path / "a.bsdf"), letters="abc", numbers=FIELDS["numbers"])
    fields = parse((tmp_path / "a.bsdf").read_bytes(), "a.bsdf")
    assert fields["letters"].tobytes() == b"abc"
    np.testing.assert_array_equal(fields["numbers"], FIELDS["numbers"])


def test_a_file_cut_anywhere_is_refused(tensor_bytes):
    whole = tensor_bytes({"numbers": FIELDS["numbers"], "letters": FIELDS["letters"]})
    for length in range(len(whole)):
        with pytest.raises(FittersError, match=r"^a\.bsdf"):
            parse(whole[:length], "a.bsdf")


def header(count=1, version=(1, 0)):
    return b"tensor_file\0" + struct.pack("<BBI", *version, count)


HOSTILE = {
    "web page": (b"<!DOCTYPE html>" + bytes(100), "does not begin with 'tensor_file'"),
    "version": (header(version=(2, 0)) + bytes(100), "version 2.0, this reader knows 1.0"),
    "many fields": (header(count=2**32 - 1) + bytes(100), "claims 4,294,967,295 fields"),
    "high rank": (
        header() + struct.pack("<H1sHBQ", 1, b"a", 60000, 10, 0) + bytes(500_000),
        "60000 dimensions",
    ),
    "unknown type": (header() + struct.pack("<H1sHBQQ", 1, b"a", 1, 99, 0, 1), "unknown element type 99"),
    "huge array": (
        header() + struct.pack("<H1sHBQ3Q", 1, b"a", 3, 10, 0, 2**60, 2**60, 2**60),
        "should end at",
    ),
    "huge empty array": (header() + struct.pack("<H1sHBQ2Q", 1, b"a", 2, 10, 0, 0, 2**63), "should end at"),
    "far away": (header() + struct.pack("<H1sHBQQ", 1, b"a", 1, 10, 2**64 - 8, 1), "should end at"),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_a_hostile_header_costs_an_error_and_nothing_more(case):
    content, message = HOSTILE[case]
    with pytest.raises(FittersError, match=message):
        parse(content, "a.bsdf")


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.tuples(st.integers(0, 2000), st.integers(0, 255)), min_size=1, max_size=8))
def test_a_damaged_measurement_is_read_or_refused_never_a_crash(simple_fields, tensor_bytes, damage):
    content = bytearray(tensor_bytes(simple_fields))
    for position, value in damage:
        content[position % len(content)] = value
    up = np.array([[0.0, 0.6, 0.8]])
    try:
        RglMaterial.from_fields(parse(bytes(content), "a.bsdf"), "a.bsdf").evaluate(up, up)
    except FittersError as error:
        assert "a.bsdf" in str(error)  # noqa: PT017
