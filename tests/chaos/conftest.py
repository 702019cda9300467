"""Without `--chaos N` or `-k`, a share of the blows."""

import pytest

from tests.chaos.share import drawn, seed_of


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    blows = [item for item in items if "chance" in getattr(item, "fixturenames", ())]
    if config.getoption("--chaos") or config.getoption("keyword") or not blows:
        return
    kept = drawn([item.name for item in blows], seed_of(config))
    left = [item for item in blows if item.name not in kept]
    config.hook.pytest_deselected(items=left)
    items[:] = [item for item in items if item not in left]
