"""What a run found, as one value: formulas and baselines, each fitted to every material.

front.json (`gpsearch-front/1`) is printed from a `Result` and read into one. What is not finite is None, since
JSON has no infinity: an error that is None is that of a model that could not be fitted.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from cattrs import transform_error
from cattrs.gen import make_dict_structure_fn, make_dict_unstructure_fn, override

from fitters.errors import FittersError
from fitters.expressions import parse
from fitters.fitting.culling import Step
from fitters.materials import Material, load_material
from fitters.models import FormulaModel, Model, material_fitter
from fitters.scenes import Scene
from gpsearch.configuration import Configuration
from gpsearch.errors import GpsearchError
from gpsearch.genomes import Genome
from gpsearch.genomes.edits import Edit
from gpsearch.run.listing import result_html, result_text
from gpsearch.run.records import json_converter

SCHEMA = "gpsearch-front/1"
FOUND, PUBLISHED = "found", "formula"
"""Kinds of formulas: of the search, and of the catalogue. Other kinds are no formulas."""

Channels = tuple[float | None, float | None, float | None]
"""Red, green, blue."""
Parameters = dict[str, dict[str, Channels]]
"""By the parameter's name, by the material's."""
Metrics = dict[str, float | None]
"""An error by the name of the metric."""


@dataclass(frozen=True, kw_only=True)
class RunInformation:
    """What was searched for, and how far.

    light_distance: relative L2 distance of the light table from its limit; None in runs that did not measure it
    problem_sha256: digest of materials, light, geometry and metric; None in runs that did not store it
    metric:         the error that `error` and `errors` are
    seconds:        of search, all sessions
    """

    name: str
    seed: int
    version: str
    config_sha256: str
    materials: tuple[str, ...]
    test_materials: tuple[str, ...] = ()
    scene: Scene
    light_distance: float | None = None
    problem_sha256: str | None = None
    metric: str
    generations: int
    candidates: int
    seconds: float


@dataclass(frozen=True, kw_only=True)
class FitOnTests:
    """A model refitted to the test materials, its structure as it is.

    error:      over all of them; None where a fit is missing or not finite
    errors:     by material; None where there is no fit
    parameters: of a formula; materials that it could not be fitted to are left out
    """

    error: float | None
    errors: dict[str, Channels]
    metrics: Metrics
    warnings: tuple[str, ...]
    parameters: Parameters | None = None


class Entry:
    """A model of a result with its fit to every material: a `FoundFormula` or a `Baseline`."""

    parameters: Parameters | None
    error: float | None
    errors: dict[str, Channels]
    warnings: tuple[str, ...]
    test: FitOnTests | None

    @property
    def test_error(self) -> float | None:
        """Over the test materials; None where there are none, or one could not be fitted."""
        return self.test.error if self.test else None

    @property
    def all_errors(self) -> dict[str, Channels]:
        """Of each channel by material, test materials among them."""
        return self.errors | (self.test.errors if self.test else {})

    def warnings_about(self, materials: Sequence[str]) -> tuple[str, ...]:
        """What to know of the fit; of the fits to test materials only where one of them is among the materials."""
        if self.test is None or not set(materials) & set(self.test.errors):
            return self.warnings
        return (*self.warnings, *self.test.warnings)

    def parameters_on(self, material: str) -> Parameters | None:
        """A formula's parameters for a material; None for a test material that it could not be fitted to."""
        if material in self.errors:
            return self.parameters
        assert self.test is not None
        return None if None in self.test.errors[material] else self.test.parameters


@dataclass(frozen=True)
class Origin:
    """Where a formula was bred; generation 0 is a start as it is."""

    island: int
    generation: int


@dataclass(frozen=True)
class Culling:
    """The formula that a listed one is left of, its error on all cells, and the steps that led there."""

    expression: str
    nodes: int
    error: float
    steps: tuple[Step, ...]


@dataclass(frozen=True, kw_only=True)
class FoundFormula(Entry):
    """A formula that was found.

    checks: `reciprocity` (largest relative difference), `minimum` (on lit cells, sr^-1) and `albedo_max`
    culled: where the expression is what culling has left of another one, which `genome` makes
    """

    kind: ClassVar[str] = FOUND
    fit_seconds: ClassVar[None] = None

    id: str
    expression: str
    nodes: int
    parameters: Parameters
    error: float
    errors: dict[str, Channels]
    metrics: Metrics
    cost_ns: float
    start: str
    edits: tuple[Edit, ...]
    origin: Origin
    checks: Metrics
    warnings: tuple[str, ...]
    culled: Culling | None = None
    test: FitOnTests | None = None

    @property
    def name(self) -> str:
        return self.id

    @property
    def genome(self) -> Genome:
        return Genome(self.start, self.edits)

    @property
    def title(self) -> str:
        """The name as tables show it: what was found has its size beside it."""
        return f"{self.id} ({self.nodes} nodes)"

    @property
    def floats(self) -> int:
        """Numbers stored per material, all three channels."""
        return 3 * len(self.parameters)


@dataclass(frozen=True, kw_only=True)
class Baseline(Entry):
    """A reference fit: a published formula, or tables, which have no expression, nodes and parameters.

    kind:   `formula` (published), `factors`, `table` or `power-iterations`
    floats: numbers stored per material, 0 where no fit succeeded
    """

    name: str
    kind: str
    expression: str | None = None
    nodes: int | None = None
    floats: int
    parameters: Parameters | None = None
    error: float | None
    errors: dict[str, Channels]
    metrics: Metrics
    cost_ns: float
    warnings: tuple[str, ...]
    fit_seconds: float
    test: FitOnTests | None = None

    @property
    def title(self) -> str:
        return self.name


@dataclass(frozen=True, repr=False)
class Result:
    """What a run found. `gpsearch.load_run` makes one of a run directory, `Result.read` one of a front.json.

    formulas:      the front: sorted by size, the error strictly falling
    baselines:     in the order of the configuration
    configuration: says where the materials are; None where the result was read from JSON
    missing:       members of the front that are not described yet, and so are not among the formulas
    hashes:        of the content of materials, by name, as far as the run has stored them
    """

    run: RunInformation
    formulas: tuple[FoundFormula, ...]
    baselines: tuple[Baseline, ...]
    configuration: Configuration | None = field(default=None, compare=False)
    missing: int = field(default=0, compare=False)
    hashes: Mapping[str, str] = field(default_factory=dict, compare=False)

    @property
    def source(self) -> Configuration:
        """The configuration of the run. Raises `GpsearchError` where the result was read from JSON."""
        if self.configuration is None:
            raise GpsearchError(f"{self.run.name}: front.json does not say where the materials are; load the run")
        return self.configuration

    @property
    def entries(self) -> tuple[FoundFormula | Baseline, ...]:
        """The formulas, then the baselines."""
        return (*self.formulas, *self.baselines)

    def entry(self, name: str) -> FoundFormula | Baseline:
        """The formula with an id, or the baseline with a name. Raises `GpsearchError` where there is neither."""
        for entry in self.entries:
            if entry.name == name:
                return entry
        names = ", ".join(entry.name for entry in self.entries)
        raise GpsearchError(f"{self.run.name}: there is no model {name!r}; there are {names or 'none'}")

    def model(self, name: str, material: str | Material) -> Model:
        """The model of a material by a formula's id or a baseline's name; the material itself or its name.

        Tables are read from the disk cache or fitted again, for which the material is loaded. Raises
        `GpsearchError` for an unknown name, `FittersError` where the model could not be fitted to the material.
        """
        entry = self.entry(name)
        called, known = material if isinstance(material, str) else material.name, entry.all_errors
        if called not in known:
            raise GpsearchError(f"{self.run.name}: no model is of {called!r}; there are {', '.join(known)}")
        if entry.expression is None and isinstance(material, str):
            material = self._load(material)
        return model_of(entry, material)

    def _load(self, name: str) -> Material:
        source = self.source
        names = (*source.material_names, *source.test_material_names)
        references = (*source.materials, *source.test_materials)
        return load_material(references[names.index(name)], base=source.folder)

    def to_json(self) -> dict[str, Any]:
        """The content of front.json, plain objects. Its JSON Schema is `gpsearch.exports.schema()`."""
        return {"schema": SCHEMA, **_CONVERTER.unstructure(self)}

    def to_text(self) -> str:
        """front.json; the same result gives the same text."""
        return json.dumps(self.to_json(), indent=1, allow_nan=False) + "\n"

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> "Result":
        """The result that front.json holds. Raises `GpsearchError` for what is none."""
        if not isinstance(content, Mapping) or content.get("schema") != SCHEMA:
            raise GpsearchError(f"not a result of a run: its `schema` is not {SCHEMA}")
        try:
            return _CONVERTER.structure(content, cls)
        except Exception as error:
            reasons = "; ".join(transform_error(error)[:3])
            raise GpsearchError(f"not a result of a run: {reasons}") from None

    @classmethod
    def read(cls, path: Path | str) -> "Result":
        """The result that a front.json file holds. Raises `GpsearchError` for a file that is none."""
        try:
            return cls.from_json(json.loads(Path(path).read_text()))
        except (OSError, ValueError) as error:
            raise GpsearchError(f"{path}: cannot be read as front.json ({error})") from None

    def __repr__(self) -> str:
        return result_text(self)

    def _repr_html_(self) -> str:
        return result_html(self)


def model_of(entry: FoundFormula | Baseline, material: str | Material) -> Model:
    """The model of a material; `material` is loaded where the entry is no formula. Raises `FittersError`."""
    name = material if isinstance(material, str) else material.name
    if entry.expression is None:
        assert not isinstance(material, str)
        return material_fitter(entry.name).kept(material).model
    parameters = entry.parameters_on(name)
    if parameters is None:
        raise FittersError(f"{entry.name}: it could not be fitted to {name}")
    expression = parse(entry.expression)
    columns = [parameters[symbol][name] for symbol in expression.parameters]
    return FormulaModel(expression, np.array(columns, np.float64).T.reshape(3, len(columns)))


_CONVERTER = json_converter()
_NAMES: dict[type, dict[str, Any]] = {
    Culling: {"expression": override(rename="from")},
    FitOnTests: {},
    RunInformation: {},
    FoundFormula: {"edits": override(rename="genome")},
    Baseline: {},
    Result: {
        "formulas": override(rename="front"),
        "configuration": override(omit=True),
        "missing": override(omit=True),
        "hashes": override(omit=True),
    },
}
"""The types of front.json, inner ones first, with the fields that it names otherwise or does not hold."""


def _register(kind: type, names: dict[str, Any]) -> None:
    """Has the converter take a type; fields that may be missing are left out where they are None or empty."""
    whole: Callable[[Any], dict[str, Any]] = make_dict_unstructure_fn(kind, _CONVERTER, **names)
    optional = {one.name for one in fields(kind) if one.default is not MISSING}

    def unstructure(value: Any) -> dict[str, Any]:
        return {
            name: plain for name, plain in whole(value).items() if name not in optional or plain not in (None, [])
        }

    _CONVERTER.register_unstructure_hook(kind, unstructure)
    _CONVERTER.register_structure_hook(kind, make_dict_structure_fn(kind, _CONVERTER, **names))


for _kind, _names in _NAMES.items():
    _register(_kind, _names)
