"""Times of closures, taken in turns."""

import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fitters.grid import Array
from fitters.judging.timing.closure import Closure
from fitters.judging.timing.loop import call_each

ROUNDS = 15


@dataclass(frozen=True)
class Timing:
    """Nanoseconds per call, loop and call included: the median of the rounds, and their quartiles."""

    ns: float
    low: float
    high: float


def measure(
    closures: Mapping[str, Closure], directions: tuple[Array, Array], rounds: int = ROUNDS
) -> dict[str, Timing]:
    """The time of a call of each closure at w_i and w_o (n, 3), of one thread.

    In every round each is called at all the directions, in an order of its own: what else happens on the machine
    hits all alike. Calls do not wait for each other's results, so this is throughput: a processor has several of
    them under way. Time of the thread counts, not time in which another program ran.
    """
    w_i, w_o = directions
    last = np.empty((1, 3))
    order = np.random.default_rng(0)
    names = list(closures)
    found: dict[str, list[float]] = {name: [] for name in names}
    for number in range(rounds + 1):
        for k in order.permutation(len(names)):
            one = closures[names[k]]
            began = time.thread_time_ns()
            call_each(one.address, w_i, w_o, one.addresses.ctypes.data, last)
            # The first round is to fetch code and tables.
            if number:
                found[names[k]].append((time.thread_time_ns() - began) / len(w_i))
    return {name: Timing(*np.percentile(ns, (50, 25, 75)).tolist()) for name, ns in found.items()}
