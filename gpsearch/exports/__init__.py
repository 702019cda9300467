"""What a run found, in forms that other programs read: a registry of targets.

To add a target, write a module with a `Target` (`gpsearch.exports.targets` has functions that make one) and name
it in `TARGETS`; `gpsearch export --format` then offers it, and the tests run `gpsearch.exports.contract` on it.
"""

from gpsearch.exports import front_json
from gpsearch.exports.front_json import schema
from gpsearch.exports.targets import Target

TARGETS = {target.name: target for target in (front_json.TARGET,)}
"""By the choice of `--format`; the first is the default."""

__all__ = ["TARGETS", "Target", "schema"]
