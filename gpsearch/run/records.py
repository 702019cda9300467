"""JSON forms of what a store holds: dataclasses by their fields, with the exceptions that are listed here."""

import json
from collections.abc import Iterable
from functools import lru_cache
from typing import Any, TypeVar, get_origin

import numpy as np
from cattrs import Converter
from cattrs.gen import make_dict_unstructure_fn, override

from fitters.fitting import Fit
from fitters.models import Baseline as StoredBaseline
from fitters.models import FormulaBaseline, TabulatedBaseline
from gpsearch.evolution.island import Individual
from gpsearch.genomes import Genome
from gpsearch.genomes.edits import Edit
from gpsearch.genomes.genome import edit_json
from gpsearch.run.front import Member

FORMULA = "formula"

T = TypeVar("T")


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


_CONVERTER = json_converter()
# A fit that was given up is not stored.
_CONVERTER.register_unstructure_hook(Fit, make_dict_unstructure_fn(Fit, _CONVERTER, finished=override(omit=True)))


def plain(record: Any) -> dict[str, Any]:
    """A record as plain objects."""
    if isinstance(record, Member):
        fields = {name: value for name, value in vars(record).items() if name not in ("genome", "fit")}
        genome = {"start": record.genome.start, "edits": record.genome.to_json()}
        return fields | genome | {"fit": _CONVERTER.unstructure(record.fit)}
    kind = {"kind": FORMULA} if isinstance(record, FormulaBaseline) else {}
    return kind | _CONVERTER.unstructure(record)


def text_of(record: Any) -> str:
    """A record as text."""
    return json.dumps(plain(record))


def read(stored: dict[str, Any], kind: type[T]) -> T:
    """The record of a type that plain objects hold."""
    return _CONVERTER.structure(stored, kind)


def read_member(stored: dict[str, Any]) -> Member:
    genome = Genome.from_json(stored["start"], stored["edits"])
    rest = {name: stored[name] for name in ("expression", "nodes", "island", "generation", "screened")}
    return Member(genome=genome, fit=read(stored["fit"], Fit), **rest)


def read_baseline(stored: dict[str, Any]) -> StoredBaseline:
    """A baseline without a kind is a formula: stores may be older than the others."""
    if stored.get("kind", FORMULA) == FORMULA:
        return read(stored, FormulaBaseline)
    return read(stored, TabulatedBaseline)


def population_text(population: Iterable[Individual]) -> str:
    """JSON text of a population. Genomes grow by an edit a generation and share most of them: each is
    turned into text once.
    """
    return f"[{','.join(map(_individual_text, population))}]"


def _individual_text(individual: Individual) -> str:
    genome = individual.genome
    rest = (individual.expression, individual.nodes, individual.error)
    edits = ",".join(map(_edit_text, genome.edits))
    return f"[{json.dumps(genome.start)},[{edits}],{','.join(map(json.dumps, rest))}]"


@lru_cache(maxsize=1 << 18)
def _edit_text(edit: Edit) -> str:
    return json.dumps(edit_json(edit))


def read_individual(stored: list[Any]) -> Individual:
    start, edits, expression, nodes, error = stored
    return Individual(Genome.from_json(start, edits), expression, nodes, error)


def read_stages(text: str) -> dict[str, Any]:
    """The fields of a generation that have no column of their own. The oldest stores hold the stages alone."""
    stored = json.loads(text)
    if "stages" not in stored:
        return {"stages": stored}
    arrived = tuple((nodes, error) for nodes, error in stored["arrived"])
    return {"stages": stored["stages"], "at": stored["at"], "arrived": arrived}
