"""What a run found, in forms that others read."""

import json
from importlib import resources
from typing import Any


def schema() -> dict[str, Any]:
    """The JSON Schema of front.json, which `Result.to_json` fulfils."""
    return json.loads(resources.files(__package__).joinpath("front.schema.json").read_text())
