"""Options of the whole suite."""

import pytest

from tests.chaos.tally import TALLY


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--chaos", type=int, default=0, help="rounds of the whole chaos suite; 0, a share of it")
    parser.addoption("--chaos-seed", type=int, default=None, help="of its random moments, which it prints")


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if TALLY.runs:
        terminalreporter.section("chaos")
        for line in TALLY.lines():
            terminalreporter.line(line)
