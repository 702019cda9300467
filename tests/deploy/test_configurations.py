"""Every gpsearch configuration of the recipes is one."""

from pathlib import Path

import pytest

from gpsearch.configuration import parse_configuration
from tests.deploy.paths import DEPLOY

CONFIGURATIONS = [DEPLOY / "quickstart.yaml", DEPLOY / "examples/rgl.yaml", *sorted(DEPLOY.glob("*/search.yaml"))]


@pytest.mark.parametrize("path", CONFIGURATIONS, ids=lambda path: str(path.relative_to(DEPLOY)))
def test_is_valid(path: Path) -> None:
    parse_configuration(path.read_text(), source=str(path), folder=path.parent, check_files=False)
