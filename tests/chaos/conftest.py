"""Without `--chaos N` or `-k`, a share of the blows: the storm, and two more that are drawn."""

import random

import pytest

ALWAYS = "a storm"
DRAWN = 2


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    blows = [item for item in items if "chance" in getattr(item, "fixturenames", ())]
    if config.getoption("--chaos") or config.getoption("keyword") or not blows:
        return
    kept = drawn([item.name for item in blows], config.getoption("--chaos-seed"))
    left = [item for item in blows if item.name not in kept]
    config.hook.pytest_deselected(items=left)
    items[:] = [item for item in items if item not in left]


def drawn(names: list[str], seed: int) -> set[str]:
    """The tests that are kept of those named."""
    others = sorted(name for name in names if ALWAYS not in name)
    kept = random.Random(seed).sample(others, min(DRAWN, len(others)))
    return {*kept, *(name for name in names if ALWAYS in name)}
