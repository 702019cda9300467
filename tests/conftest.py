"""Options of the whole suite."""

import pytest

from tests.chaos.tally import TALLY


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--chaos", type=int, default=1, help="rounds of the chaos suite, default 1")
    parser.addoption("--chaos-seed", type=int, default=None, help="of its random moments, which it prints")


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if TALLY.runs:
        terminalreporter.section("chaos")
        for line in TALLY.lines():
            terminalreporter.line(line)
