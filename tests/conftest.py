"""Options of the whole suite: without `--long`, what repeats a property or takes long is left out."""

import os
from typing import Any

import pytest
from hypothesis import settings

from tests.chaos.tally import TALLY

settings.register_profile("quick", deadline=None, max_examples=30)
settings.register_profile("long", deadline=None, max_examples=300)

TOLD: list[str] = []
"""Lines of the chaos suite's summary from processes of pytest-xdist."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--long", action="store_true", help="the tests marked `long` too, and more examples")
    parser.addoption("--chaos", type=int, default=0, help="rounds of the whole chaos suite; 0, a share of it")
    parser.addoption("--chaos-seed", type=int, default=None, help="of its random moments, which it prints")


def _is_long(config: pytest.Config) -> bool:
    return config.getoption("--long") or config.getoption("--chaos") > 0


def pytest_configure(config: pytest.Config) -> None:
    settings.load_profile("long" if _is_long(config) else "quick")
    if hasattr(config, "workerinput"):
        config.option.chaos_seed = config.workerinput["chaos_seed"]
    elif config.getoption("--chaos-seed") is None:
        config.option.chaos_seed = int.from_bytes(os.urandom(3), "big")


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node) -> None:
    """Gives a process of pytest-xdist the seed of all: they must collect the same tests."""
    node.workerinput["chaos_seed"] = node.config.getoption("--chaos-seed")


def pytest_report_header(config: pytest.Config) -> str:
    return "long tests: " + ("included" if _is_long(config) else "left out, --long includes them")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leaves the long tests out, or puts the files that hold them first, so that none begins at the end."""
    long = [item for item in items if item.get_closest_marker("long")]
    if _is_long(config):
        files = {item.path for item in long}
        items.sort(key=lambda item: item.path not in files)
    elif long:
        config.hook.pytest_deselected(items=long)
        items[:] = [item for item in items if item not in long]


def pytest_sessionfinish(session: pytest.Session) -> None:
    if TALLY.runs and hasattr(session.config, "workeroutput"):
        session.config.workeroutput["chaos"] = TALLY.lines()


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any, error: object) -> None:
    """What a worker process of pytest-xdist tells when it ends."""
    TOLD.extend(getattr(node, "workeroutput", {}).get("chaos", []))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    lines = TALLY.lines() if TALLY.runs else TOLD
    if lines:
        terminalreporter.section("chaos")
        for line in lines:
            terminalreporter.line(line)
