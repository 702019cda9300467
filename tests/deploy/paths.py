"""Where the recipes are, and their YAML."""

from pathlib import Path
from typing import Any

import yaml

REPOSITORY = Path(__file__).parents[2]
DEPLOY = REPOSITORY / "deploy"


def documents(path: Path) -> list[dict[str, Any]]:
    """The documents of a YAML file; a key that stands twice is not noticed."""
    return list(yaml.safe_load_all(path.read_text()))
