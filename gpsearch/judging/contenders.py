"""The models of a result that compete: formulas and baselines, loaded for some materials."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from fitters.errors import FittersError
from fitters.materials import Material, load_material
from fitters.models import Model
from gpsearch.configuration import Configuration
from gpsearch.run import Baseline, FoundFormula, Result
from gpsearch.run.identity import require_content


@dataclass(frozen=True, eq=False)
class Contender:
    """A formula or a baseline with its models, which are large, of the materials that are asked for.

    models:   by material's name; what could not be fitted is not there, and a warning says why
    warnings: about the fits to these materials
    """

    entry: FoundFormula | Baseline
    models: Mapping[str, Model]
    warnings: tuple[str, ...] = ()


def materials_of(configuration: Configuration) -> tuple[Material, ...]:
    """The materials of a run, loaded. Raises `FittersError` where one is no longer there."""
    return tuple(load_material(reference, base=configuration.folder) for reference in configuration.materials)


def load_contenders(result: Result, materials: Sequence[Material]) -> list[Contender]:
    """The entries of a result, in their order, with the models of some of its materials, also test materials.

    Tables are read from the disk cache, or fitted again. Raises `GpsearchError` where the content of a material is
    not what it was in the run.
    """
    for material in materials:
        require_content(result.hashes, material, result.run.name)
    names = [material.name for material in materials]
    return [
        Contender(entry, _models(result, entry.name, materials), entry.warnings_about(names))
        for entry in result.entries
    ]


def _models(result: Result, name: str, materials: Sequence[Material]) -> dict[str, Model]:
    models = {}
    for material in materials:
        try:
            models[material.name] = result.model(name, material)
        except FittersError:
            continue  # the entry's warnings say why
    return models


def joined(one: Contender, other: Contender) -> Contender:
    """The same contender with the models of both, each of other materials."""
    warnings = tuple(dict.fromkeys((*one.warnings, *other.warnings)))
    return replace(one, models={**one.models, **other.models}, warnings=warnings)
