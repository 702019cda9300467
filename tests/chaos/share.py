"""Which of the blows a run of the suite deals that does not ask for all of them."""

import os
import random
from functools import cache

import pytest

ALWAYS = "a storm"
DRAWN = 2


@cache
def seed_of(config: pytest.Config) -> int:
    """The seed of the random moments, and of the draw."""
    given = config.getoption("--chaos-seed")
    return int.from_bytes(os.urandom(3), "big") if given is None else given


def drawn(names: list[str], seed: int) -> set[str]:
    """The tests that are kept of those named: the storm, and two more."""
    others = sorted(name for name in names if ALWAYS not in name)
    kept = random.Random(seed).sample(others, min(DRAWN, len(others)))
    return {*kept, *(name for name in names if ALWAYS in name)}
