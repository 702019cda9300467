"""Seeds are derived, never drawn: the same run, island, generation and role give the same random numbers."""

from enum import IntEnum

import numpy as np


class Role(IntEnum):
    """What random numbers are for. The numbers are part of a run's identity: never change or reuse one."""

    FOUND = 0
    ADVANCE = 1
    CELLS = 2


def generator(run_seed: int, island: int, generation: int, role: Role) -> np.random.Generator:
    """The generator of one role in one generation of one island."""
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence((run_seed, island, generation, int(role)))))


def cells_seed(run_seed: int) -> int:
    """The seed of the sample of cells, one for a whole run."""
    return int(generator(run_seed, 0, 0, Role.CELLS).integers(2**31))
