"""The target `json`: front.json, version 1, as `gpsearch.run.Result` prints it."""

import json
from importlib import resources
from typing import Any

from gpsearch.exports.targets import of_run
from gpsearch.run import Result

TARGET = of_run("json", "the front and the baselines (gpsearch-front/1)", "front.json", Result.to_text)


def schema() -> dict[str, Any]:
    """The JSON Schema of front.json, which `Result.to_json` fulfils."""
    return json.loads(resources.files(__package__).joinpath("front.schema.json").read_text())
