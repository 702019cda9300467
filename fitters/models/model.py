"""What every model of one material answers: values, size, times, sampled directions, arrays to keep."""

import time
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from fitters.errors import FittersError
from fitters.grid import Array

if TYPE_CHECKING:
    from fitters.expressions import Expression
    from fitters.models.model_code import ModelCode

COST_DIRECTIONS, COST_ROUNDS = 16384, 9


class Model(ABC):
    """The reflectance of one material, three channels.

    Directions are unit vectors (n, 3), the normal is +z; w_i points to the light, w_o to the viewer.

    `kind` names the class in a saved file. `fit_seconds` is what the fit of all three channels took. `expression`
    is there where the model is a formula.
    """

    kind: ClassVar[str]
    fit_seconds: float = 0.0
    expression: "Expression | None" = None

    @property
    @abstractmethod
    def floats(self) -> int:
        """Numbers to store per material, all three channels."""

    @property
    @abstractmethod
    def reciprocal(self) -> bool:
        """Whether f(w_i, w_o) = f(w_o, w_i) is claimed."""

    @abstractmethod
    def evaluate(self, w_i: Array, w_o: Array) -> Array:
        """BRDF values (n, 3) in sr^-1: finite, not negative, 0 where a direction is not above the horizon."""

    @abstractmethod
    def sample(self, w_o: Array, u: Array) -> Array:
        """Directions w_i (n, 3) for views (n, 3) and uniform numbers (n, 3) in [0, 1).

        Some may lie below the horizon, where the BRDF is 0.
        """

    @abstractmethod
    def pdf(self, w_i: Array, w_o: Array) -> Array:
        """The density (n,) with which `sample` returns w_i, sr^-1; over the whole sphere it integrates to 1."""

    @abstractmethod
    def arrays(self) -> dict[str, np.ndarray]:
        """What to keep, under the papers' names: `from_arrays` makes an equal model of it."""

    @classmethod
    @abstractmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray]) -> "Model":
        """The model that `arrays` came from."""

    @property
    def named_parameters(self) -> dict[str, tuple[float, float, float]]:
        """Of a formula: its parameters `p0`.. by name, of the three channels; of any other model none."""
        return {}

    def scalar_code(self) -> "ModelCode":
        """The model as code for one pair of directions, which `fitters.judging.timing` compiles and times.

        Raises `FittersError` where a kind of model has none.
        """
        raise FittersError(
            f"{self.kind} has no code for one pair of directions: define {type(self).__name__}.scalar_code"
        )

    def cost_ns(self) -> float:
        """Nanoseconds per evaluation of a channel on this machine, one thread, directions given.

        The median of a few rounds over random directions. A measurement: it differs from run to run.
        """
        rng = np.random.default_rng(0)
        w = rng.normal(size=(2, COST_DIRECTIONS, 3))
        w[..., 2] = np.abs(w[..., 2]) + 0.1
        w /= np.linalg.norm(w, axis=-1, keepdims=True)
        self.evaluate(w[0], w[1])
        seconds = []
        for _ in range(COST_ROUNDS):
            started = time.perf_counter()
            self.evaluate(w[0], w[1])
            seconds.append(time.perf_counter() - started)
        return float(np.median(seconds)) / (3 * COST_DIRECTIONS) * 1e9
