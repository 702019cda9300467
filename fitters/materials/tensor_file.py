"""The `tensor_file` container, version 1, that the RGL database and Mitsuba 3 exchange arrays in.

Little-endian: 12 bytes of magic, 2 of version, a uint32 count of fields; per field a uint16 length and the
UTF-8 name, uint16 rank, uint8 element type, uint64 offset of the data, and rank uint64 sizes. Every number is
checked against the file before it is used: a malicious file causes an error, never an allocation.
"""

import struct
from collections.abc import Mapping
from math import prod

import numpy as np

from fitters.errors import FittersError

MAGIC = b"tensor_file\0"
VERSION = (1, 0)
MAX_RANK = 16
MAX_FIELDS = 1024
ELEMENT_TYPES: Mapping[int, np.dtype] = {
    code: np.dtype(name).newbyteorder("<")
    for code, name in enumerate(("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f2", "f4", "f8"), start=1)
}


class _Cursor:
    """Reads the header from front to back; raises `FittersError` where the file ends before."""

    def __init__(self, data: bytes, name: str) -> None:
        self.data, self.name, self.position = data, name, 0

    def take(self, count: int) -> bytes:
        end = self.position + count
        if end > len(self.data):
            raise FittersError(
                f"{self.name} ends inside its header, after {len(self.data):,} bytes: the download was cut "
                "short or the file is damaged. Fetch it again."
            )
        piece, self.position = self.data[self.position : end], end
        return piece

    def unpack(self, layout: str) -> tuple[int, ...]:
        return struct.unpack(f"<{layout}", self.take(struct.calcsize(f"<{layout}")))


def parse(data: bytes, name: str) -> dict[str, np.ndarray]:
    """The fields of a tensor file as read-only views of `data`; `name` is the file's name in messages.

    Raises `FittersError` where the content is not a whole tensor file of version 1.0.
    """
    if data[: len(MAGIC)] != MAGIC:
        raise FittersError(
            f"{name} does not begin with {MAGIC.rstrip(bytes(1)).decode()!r}: it is not an RGL measurement. "
            "Check that the download is the .bsdf file itself, not a web page."
        )
    cursor = _Cursor(data, name)
    cursor.take(len(MAGIC))
    version = cursor.unpack("BB")
    if version != VERSION:
        raise FittersError(
            f"{name} is a tensor file of version {version[0]}.{version[1]}, this reader knows 1.0. "
            "Look for a newer gpsearch or an older file."
        )
    (count,) = cursor.unpack("I")
    if count > MAX_FIELDS:
        raise FittersError(f"{name} claims {count:,} fields: the file is damaged. Fetch it again.")
    fields: dict[str, np.ndarray] = {}
    for _ in range(count):
        label, array = _field(cursor)
        fields[label] = array
    return fields


def _field(cursor: _Cursor) -> tuple[str, np.ndarray]:
    (length,) = cursor.unpack("H")
    label = cursor.take(length).decode("utf-8", errors="replace")
    where = f"{cursor.name}: field {label!r}"
    rank, code, offset = cursor.unpack("HBQ")
    if rank > MAX_RANK:
        raise FittersError(f"{where} claims {rank} dimensions: the file is damaged. Fetch it again.")
    shape = cursor.unpack(f"{rank}Q")
    if code not in ELEMENT_TYPES:
        raise FittersError(f"{where} has the unknown element type {code}: the file is damaged. Fetch it again.")
    dtype = ELEMENT_TYPES[code]
    end = offset + prod(shape) * dtype.itemsize
    # An array without elements may still claim sizes that are too large for any array.
    claimed = prod(max(size, 1) for size in shape) * dtype.itemsize
    if max(end, claimed) > len(cursor.data):
        raise FittersError(
            f"{where} should end at byte {max(end, claimed):,}, the file holds {len(cursor.data):,}: the "
            "download was cut short or the file is damaged. Fetch it again."
        )
    return label, np.frombuffer(cursor.data, dtype, prod(shape), offset).reshape(shape)
