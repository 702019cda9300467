"""An expression made ready to be fitted on some cells: lowered, its vectors laid out, its record filled."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fitters.backends.machine import kernel_address
from fitters.backends.program import Program, lower
from fitters.engine.coordinates import Coordinates
from fitters.engine.multistart import Descent, add_squares, fit_targets, polish_targets, state_targets
from fitters.engine.objective import MACHINE
from fitters.engine.projection import BLOCK
from fitters.expressions.expression import Expression
from fitters.grid import Array


def linear_units(program: Program, units: Array | None) -> Array | None:
    """The units (targets,) of a program's linear parameters; None where they are 1 or it has an offset, too."""
    return None if units is None or not program.linear or program.outputs[0] >= 0 else units


def in_units(weights: NDArray[np.float32], units: Array) -> NDArray[np.float32]:
    """Weights (targets, n) of values that are given in units (targets,)."""
    return np.ascontiguousarray(weights * units[:, None], np.float32)


@dataclass(frozen=True, eq=False)
class Optima:
    """The best of all descents.

    x:               (targets, searched) coordinates
    c:               (targets, linear) coefficients
    value:           (targets,) sums of squares
    evaluations:     of the objective, over all targets
    finished:        False where the fit was given up
    """

    x: NDArray[np.float64]
    c: NDArray[np.float64]
    value: NDArray[np.float64]
    evaluations: int = 0
    finished: bool = True


class Prepared:
    """Keeps alive all arrays that its records have the addresses of: `machine` over all cells, `coarse` over few.

    features: each (n,) float64; weights and weighted (weights times measured values): (targets, n) float32,
    contiguous; coarse: such a pair (targets, m) for the first m cells alone, by default the same as for all;
    bounds: an interval per parameter, searched in the logarithm where it is positive; units: (targets,) of linear
    parameters where the expression has nothing else, so that their bounds count in them.
    """

    def __init__(
        self,
        expression: Expression,
        features: dict[str, Array],
        weights: NDArray[np.float32],
        weighted: NDArray[np.float32],
        bounds: Mapping[str, tuple[float, float]],
        coarse: tuple[NDArray[np.float32], NDArray[np.float32]] | None = None,
        units: Array | None = None,
    ) -> None:
        self.program = program = lower(expression)
        self.units = linear_units(program, units)
        if self.units is not None:
            weights = in_units(weights, self.units)
            coarse = None if coarse is None else (in_units(coarse[0], self.units), coarse[1])
        self.space = Coordinates(program, bounds)
        self._kept: list[NDArray] = [weights, weighted]
        self.machine = self._record(features, weights, weighted)
        self.coarse = self.machine if coarse is None else self._over_first_cells(*coarse)

    @property
    def searched(self) -> int:
        """How many parameters a simplex varies."""
        return self.space.searched

    @property
    def box(self) -> NDArray[np.float64]:
        """Lower and upper bounds (2, searched) in coordinates."""
        return self.space.box[:, : self.searched]

    def fit(self, starts: Array, near: Array, descent: Descent) -> "Optima":
        """`multistart.fit_targets` over the coarse cells; starts (s, searched), near (targets or 0, searched)."""
        optima = self.optima(np.zeros((len(self._kept[0]), self.searched)))
        used, finished = fit_targets(self.coarse, starts, near, descent, optima.x, optima.value)
        state_targets(self.coarse, optima.x, optima.value, optima.c)
        return replace(optima, evaluations=used, finished=finished)

    def polish(self, descent: Descent, optima: "Optima") -> "Optima":
        """`multistart.polish_targets` over all cells, from optima that are there."""
        polished = self.optima(optima.x.copy())
        used = polish_targets(self.machine, descent, polished.x, polished.value, polished.c)
        return replace(polished, evaluations=optima.evaluations + used)

    def squares(self, optima: "Optima") -> NDArray[np.float64]:
        """Squared weighted residuals (n,) over all cells, summed over targets."""
        squares = np.zeros(int(self.machine["cells"]))
        add_squares(self.machine, optima.x, optima.c, squares)
        return squares

    def optima(self, x: NDArray[np.float64]) -> "Optima":
        """Coordinates (targets, searched) with nothing known of them."""
        return Optima(x, np.zeros((len(x), len(self.program.linear))), np.full(len(x), np.inf))

    def coordinates(self, parameters: Mapping[str, Array]) -> NDArray[np.float64]:
        """The simplex coordinates (targets, searched) of parameters, each (targets,)."""
        if not parameters:
            return np.zeros((len(self._kept[0]), 0))
        return np.ascontiguousarray(self.space.of(parameters)[:, : self.searched])

    def parameters(self, optima: "Optima") -> dict[str, Array]:
        """Parameters, each (targets,), of optima; in order of number."""
        c = optima.c if self.units is None else optima.c * self.units[:, None]
        return self.space.parameters(np.concatenate([optima.x, c], axis=1))

    def _record(self, features: dict[str, Array], weights: NDArray, weighted: NDArray) -> np.void:
        program, n = self.program, weights.shape[1]
        k = len(program.linear)
        inputs = program.input_vectors(features)
        written = np.empty((max(program.persistent - len(program.inputs), 1), n), np.float32)
        temporaries = np.empty((max(program.temporaries, 1), BLOCK), np.float32)
        base = np.concatenate(
            [
                _rows(inputs)[: len(program.inputs)],
                _rows(written)[: program.persistent - len(program.inputs)],
                _rows(temporaries)[: program.temporaries],
            ]
        )
        advance = np.where(np.arange(len(base)) < program.persistent, 4, 0)
        self._kept += [inputs, written, temporaries]
        outputs = [base[slot] if slot >= 0 else 0 for slot in program.outputs]
        fields = {
            "kernel": kernel_address(),
            "code": self._address(program.code),
            "instructions": len(program.code),
            "scalar_code": self._address(program.scalar_code),
            "scalar_instructions": len(program.scalar_code),
            "registers": self._address(program.scalars.copy()),
            "scalars": self._address(np.zeros(len(program.scalars), np.float32)),
            "registers_count": len(program.scalars),
            "base": self._address(base),
            "advance": self._address(advance),
            "slots": self._address(np.zeros(len(base), np.int64)),
            "slots_count": len(base),
            "outputs": self._address(np.array(outputs, np.int64)),
            "searched": len(program.searched),
            "linear": k,
            "logarithmic": self._address(self.space.logarithmic[: self.searched].astype(np.float64)),
            "box": self._address(self.box.copy()),
            "linear_box": self._address(self.space.box[:, self.searched :].copy()),
            "normal": self._address(np.zeros((k + 1, k))),
            "scratch": self._address(np.empty(BLOCK, np.float32)),
            "weights": self._address(_rows(weights)),
            "weighted": self._address(_rows(weighted)),
            "cells": n,
        }
        return np.array([tuple(fields[name] for name in MACHINE.names or ())], MACHINE)[0]

    def _over_first_cells(self, weights: NDArray, weighted: NDArray) -> np.void:
        """The record over as many of the first cells as there are columns: only weights and targets differ."""
        record = np.array(self.machine, MACHINE)
        record["weights"] = self._address(_rows(weights))
        record["weighted"] = self._address(_rows(weighted))
        record["cells"] = weights.shape[1]
        self._kept += [weights, weighted]
        return record.reshape(1)[0]

    def _address(self, array: NDArray) -> int:
        self._kept.append(array)
        return int(array.ctypes.data)


def _rows(array: NDArray) -> NDArray[np.int64]:
    """Addresses of the rows of a contiguous array."""
    return array.ctypes.data + array.strides[0] * np.arange(len(array))
