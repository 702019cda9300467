"""Where the recipes are, and their YAML."""

import sys
from pathlib import Path
from typing import Any

import yaml

REPOSITORY = Path(__file__).parents[2]
DEPLOY = REPOSITORY / "deploy"


def installed(name: str) -> Path:
    """A command that came with the packages of the tests, also where their environment is not on the path."""
    return Path(sys.executable).with_name(name)


def documents(path: Path) -> list[dict[str, Any]]:
    """The documents of a YAML file; a key that stands twice is not noticed."""
    return list(yaml.safe_load_all(path.read_text()))
