"""Models as compiled functions of one signature, (w_i, w_o, tables, values), called through their address.

Compiled in memory, some tenths of a second each: nobody asks for the same formula twice.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import carray, cfunc, from_dtype, njit, types

from fitters.backends.math32 import address_as
from fitters.backends.scalar_code import ScalarCode
from fitters.errors import FittersError
from fitters.grid import Array
from fitters.judging.timing.loop import call_each
from fitters.models import FormulaModel, MeasuredTable, Model
from fitters.models.directions import rows
from fitters.models.factors import BivariateTable, MicrofacetFactors, NaiveFactors, lookup
from fitters.models.power_iterations import AnisotropicMicrofacet, TabulatedMicrofacet, anisotropic_model
from fitters.models.power_iterations import model as isotropic_model

SIGNATURE = types.void(types.int64, types.int64, types.int64, types.int64)
"""Addresses of w_i (3,), w_o (3,), of the addresses of the tables, and of values (3,)."""

Scalar = Callable[[int, int, int, int], None]
Tables = tuple[np.ndarray, ...]


@dataclass(frozen=True, eq=False)
class Closure:
    """A model ready to be called: the compiled function, the tables that it reads, and how long compiling took."""

    function: Any
    tables: Tables
    addresses: np.ndarray
    compile_seconds: float

    @property
    def address(self) -> int:
        return self.function.address

    def evaluate(self, w_i: Array, w_o: Array) -> Array:
        """Values (n, 3) at directions (n, 3), one call for each: those of the model's own `evaluate`."""
        values = np.empty((len(w_i), 3))
        call_each(self.address, rows(w_i), rows(w_o), self.addresses.ctypes.data, values)
        return values


def closure(model: Model) -> Closure:
    """A model of any kind, compiled. Raises `FittersError` for a kind that has no scalar function."""
    if isinstance(model, FormulaModel):
        code = ScalarCode.of(model.expression)
        return _compiled(_formula(code.function()), (code.prepared(model.parameters),))
    if isinstance(model, TabulatedMicrofacet):
        return _compiled(_isotropic(model.tables, model.published), model.tables)
    if isinstance(model, AnisotropicMicrofacet):
        return _compiled(_anisotropic(model.tables), model.tables)
    if isinstance(model, MicrofacetFactors | NaiveFactors):
        function = lookup.naive_at if isinstance(model, NaiveFactors) else lookup.microfacet_at
        tables = tuple(model.arrays().values())
        return _compiled(_factors(function, tables), tables)
    if isinstance(model, BivariateTable):
        return _compiled(_one_table(lookup.bivariate_at, model["B"]), (model["B"],))
    if isinstance(model, MeasuredTable):
        return _compiled(_one_table(lookup.measured_at, model.table), (model.table,))
    raise FittersError(
        f"{model.kind} has no compiled scalar function: add one to fitters/judging/timing/closure.py"
    )


def empty() -> Closure:
    """What does nothing: its time is that of the loop and the call, which every other's holds too."""

    def call(w_i, w_o, tables, values):
        pass

    return _compiled(call, ())


def _compiled(scalar: Scalar, tables: Tables) -> Closure:
    began = time.perf_counter()
    function = cfunc(SIGNATURE, error_model="numpy")(scalar)
    addresses = np.array([table.ctypes.data for table in tables], np.int64)
    return Closure(function, tables, addresses, time.perf_counter() - began)


@njit(error_model="numpy")
def _vector(address):
    """What lies at an address, (3,)."""
    return carray(address_as(address, types.float64), (3,))


@njit(error_model="numpy")
def _table(tables, k, shape):
    """The k-th table, of float64."""
    return carray(address_as(carray(address_as(tables, types.int64), (k + 1,))[k], types.float64), shape)


def _formula(formula: Scalar) -> Scalar:
    def call(w_i, w_o, tables, values):
        formula(w_i, w_o, tables, values)

    return call


def _one_table(function: Any, table: np.ndarray) -> Scalar:
    kind, shape = from_dtype(table.dtype), table.shape

    def call(w_i, w_o, tables, values):
        only = carray(address_as(carray(address_as(tables, types.int64), (1,))[0], kind), shape)
        function(_vector(w_i), _vector(w_o), only, _vector(values))

    return call


def _factors(function: Any, tables: Tables) -> Scalar:
    rho, d, f, last = (tables[k].shape for k in (0, 2, 3, 4))

    def call(w_i, w_o, tables, values):
        function(
            _vector(w_i),
            _vector(w_o),
            _table(tables, 0, rho),
            _table(tables, 1, rho),
            _table(tables, 2, d),
            _table(tables, 3, f),
            _table(tables, 4, last),
            _vector(values),
        )

    return call


def _isotropic(tables: Tables, published: bool) -> Scalar:
    evaluate = isotropic_model.evaluate_at
    t, log_p, rate, p, area, fresnel, scale = (table.shape for table in tables)

    def call(w_i, w_o, tables, values):
        evaluate(
            _vector(w_i),
            _vector(w_o),
            _table(tables, 0, t),
            _table(tables, 1, log_p),
            _table(tables, 2, rate),
            _table(tables, 3, p),
            _table(tables, 4, area),
            _table(tables, 5, fresnel),
            _table(tables, 6, scale),
            published,
            _vector(values),
        )

    return call


def _anisotropic(tables: Tables) -> Scalar:
    evaluate = anisotropic_model.evaluate_at
    t, log_p, rate, area, fresnel, scale = (table.shape for table in tables)

    def call(w_i, w_o, tables, values):
        evaluate(
            _vector(w_i),
            _vector(w_o),
            _table(tables, 0, t),
            _table(tables, 1, log_p),
            _table(tables, 2, rate),
            _table(tables, 3, area),
            _table(tables, 4, fresnel),
            _table(tables, 5, scale),
            _vector(values),
        )

    return call
