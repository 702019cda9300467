"""Directions to call models at, and the time of a call of each model."""

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fitters.grid import Array
from fitters.judging.timing.closures import Closure, call_each

ROUNDS = 15
COUNT = 1 << 17
"""Enough for incoherent ones to read all parts of the measured table, and for one pass of any model to warm up."""


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

    In every round each is called at all directions. The order is random, so that other programs disturb all alike.
    Calls do not wait for each other's results, so this is throughput: a processor works on several at once. The
    time of the thread is measured, without the time in which another program ran.
    """
    w_i, w_o = directions
    last = np.empty((1, 3))
    order = np.random.default_rng(0)
    names = list(closures)
    times: dict[str, list[float]] = {name: [] for name in names}
    for number in range(rounds + 1):
        for k in order.permutation(len(names)):
            one = closures[names[k]]
            began = time.thread_time_ns()
            call_each(one.address, w_i, w_o, one.addresses.ctypes.data, last)
            # The first round only loads code and tables.
            if number:
                times[names[k]].append((time.thread_time_ns() - began) / len(w_i))
    return {name: Timing(*np.percentile(ns, (50, 25, 75)).tolist()) for name, ns in times.items()}


def incoherent(count: int = COUNT) -> tuple[Array, Array]:
    """Unit w_i and w_o (count, 3), each uniform over the hemisphere, in random order.

    As of a path tracer after a few bounces: no two calls in a row read the same cell of a table.
    """
    w = np.random.default_rng(0).normal(size=(2, count, 3))
    w[..., 2] = np.abs(w[..., 2])
    w /= np.linalg.norm(w, axis=-1, keepdims=True)
    return w[0], w[1]


def coherent(count: int = COUNT) -> tuple[Array, Array]:
    """About `count` pairs: the lit pixels of a sphere seen from far away, lamp at 45 degrees, row by row.

    As of a rasteriser: neighbours read the same cells, or cells that the cache has just seen.
    """
    # The share of the square around the disc that its lit part has.
    side = math.ceil(math.sqrt(count / (math.pi / 8 * (1 + math.cos(math.pi / 4)))))
    row = (np.arange(side) + 0.5) / side * 2 - 1
    y, x = (axis.ravel() for axis in np.meshgrid(row, row, indexing="ij"))
    z = np.sqrt(np.maximum(1 - x * x - y * y, 0.0))
    lamp = np.array([0.0, math.sqrt(0.5), math.sqrt(0.5)])
    normal = np.stack([x, y, z], axis=-1)[(z > 0) & (lamp[1] * y + lamp[2] * z > 0)]
    # The frame at a pixel: its x axis lies in the plane of z and x; turning it would have little effect.
    tangent = np.stack([normal[:, 2], np.zeros(len(normal)), -normal[:, 0]], axis=-1)
    tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
    frame = np.stack([tangent, np.cross(normal, tangent), normal], axis=1)
    return np.ascontiguousarray(frame @ lamp), np.ascontiguousarray(frame[:, :, 2])
