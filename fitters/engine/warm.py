"""The first compile of the engine, when the caller asks for it."""

import numpy as np

from fitters.engine.multistart import Descent
from fitters.engine.prepared import Prepared
from fitters.expressions.evaluation import FEATURES
from fitters.expressions.text import parse


def warm_up() -> None:
    """Compiles all that fits need, or loads it from the disk cache: half a minute on a new machine, once.

    Several processes that begin to fit at once would all compile the same.
    """
    cells = np.linspace(0.1, 0.9, 8)
    ones = np.ones((1, len(cells)), np.float32)
    bounds = {"p0": (0.1, 1.0), "p1": (0.1, 2.0)}
    prepared = Prepared(parse("p0 * pow(wh.z, p1)"), dict.fromkeys(FEATURES, cells), ones, ones, bounds)
    descent = Descent(1, 1, 0.5, 4, 1e-3, np.inf, np.inf)
    optima = prepared.fit(np.zeros((1, 1)), np.zeros((0, 1)), descent)
    prepared.squares(prepared.polish(descent, optima))
