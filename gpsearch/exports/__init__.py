"""What a run found, in forms that others read."""

from gpsearch.exports.front_json import front_json, schema

__all__ = ["front_json", "schema"]
