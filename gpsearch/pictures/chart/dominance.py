"""Which of several models no other beats."""

from collections.abc import Sequence

import numpy as np


def non_dominated(points: Sequence[Sequence[float]]) -> list[bool]:
    """For each point of costs whether no other is at most as high in all of them and lower in one.

    Equals do not beat each other.
    """
    if not points:
        return []
    costs = np.asarray(points, np.float64)
    # [i, j]: whether j beats i.
    at_most, below = (relation(costs[None], costs[:, None]) for relation in (np.less_equal, np.less))
    return [bool(free) for free in ~np.any(at_most.all(axis=2) & below.any(axis=2), axis=1)]
