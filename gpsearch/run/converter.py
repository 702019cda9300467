"""From dataclasses to plain objects that JSON holds, and back: arrays as lists, edits with their names."""

from typing import Any, get_origin

import numpy as np
from cattrs import Converter

from gpsearch.genomes import Genome
from gpsearch.genomes.edits import Edit
from gpsearch.genomes.genome import edit_json


def json_converter() -> Converter:
    """A converter. Python's JSON writes floats so that they read back to the last bit, infinity too."""
    converter = Converter(unstruct_collection_overrides={tuple: list})
    converter.register_unstructure_hook_func(_is_array, np.ndarray.tolist)
    converter.register_structure_hook_func(_is_array, lambda stored, _: np.array(stored, np.float64))
    converter.register_unstructure_hook(Edit, edit_json)
    converter.register_structure_hook(Edit, lambda stored, _: Genome.from_json("", [stored]).edits[0])
    return converter


def _is_array(kind: Any) -> bool:
    return get_origin(kind) is np.ndarray or kind is np.ndarray
