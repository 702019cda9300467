"""A model as code for one pair of directions, of one signature: what a renderer calls once per sample.

The code gets addresses (integers) of w_i (3,), of w_o (3,), of the addresses of its tables, and of the values (3,)
that it writes. `fitters.judging.timing` compiles it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import carray, from_dtype, njit, types

from fitters.backends.math32 import address_as

Scalar = Callable[[int, int, int, int], None]


@dataclass(frozen=True, eq=False)
class ModelCode:
    """A function that numba can compile, and the tables that it reads, contiguous and kept alive here."""

    function: Scalar
    tables: tuple[np.ndarray, ...] = ()


@njit(error_model="numpy")
def vector_at(address):
    """What lies at an address, (3,)."""
    return carray(address_as(address, types.float64), (3,))


@njit(error_model="numpy")
def table_at(tables, k, shape):
    """The k-th table, of float64."""
    return carray(address_as(carray(address_as(tables, types.int64), (k + 1,))[k], types.float64), shape)


def of_one_table(function: Any, table: np.ndarray) -> ModelCode:
    """The code of a compiled function (w_i, w_o, table, values) of one table of any type."""
    kind, shape = from_dtype(table.dtype), table.shape

    def call(w_i, w_o, tables, values):
        only = carray(address_as(carray(address_as(tables, types.int64), (1,))[0], kind), shape)
        function(vector_at(w_i), vector_at(w_o), only, vector_at(values))

    return ModelCode(call, (table,))
