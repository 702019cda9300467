"""The configuration of a run, valid and complete."""

import hashlib
import json
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import yaml
from pydantic import AfterValidator, BeforeValidator, Field, PrivateAttr

from fitters.expressions import Expression
from fitters.expressions.catalogue import CATALOGUE
from fitters.fitting import RESIDUALS
from fitters.models.baselines import TABULATED
from gpsearch.configuration.comparison import FINDS_THE_SAME, Difference, differences
from gpsearch.configuration.fields import Number, Section, Surroundings, Whole, number, one_of, section, whole
from gpsearch.configuration.references import (
    check_material,
    check_no_baseline_twice,
    check_no_material_twice,
    material_name,
)
from gpsearch.configuration.sections import (
    MAX_ENTRIES,
    Budget,
    DaskExecutor,
    FitSection,
    LocalExecutor,
    SceneSection,
    Search,
)
from gpsearch.configuration.wording import listed

BASELINES = (*CATALOGUE, *TABULATED)
DEFAULT_BASELINES = (
    "cook-torrance",
    "ggx",
    "bivariate",
    "npf-independent-g",
    "npf-g-from-d",
    "npf-naive",
    "power-iterations",
)


Materials = Annotated[
    tuple[Annotated[str, AfterValidator(check_material)], ...], AfterValidator(check_no_material_twice)
]
"""References of materials, no material twice."""


def _kind_alone(value: Any) -> Any:
    """`local` and `dask` are short for a mapping of nothing but the kind."""
    return {"kind": value} if isinstance(value, str) else value


class Configuration(Section):
    """All that decides what a run finds, where it runs, and what it is tested on.

    Frozen; equal where every key and `folder` are.
    """

    name: str = Field(
        max_length=100,
        pattern=r"^[A-Za-z0-9_][A-Za-z0-9._-]*$",
        description="letters, digits, '-', '_' and '.', the first a letter, digit or '_'; "
        "quote what looks like a number",
    )
    seed: Whole = whole(0, 0)
    materials: Materials = Field(
        min_length=1,
        max_length=MAX_ENTRIES,
        description="a list of at least one .binary or .bsdf file or builtin:NAME",
    )
    test_materials: Materials = Field(
        (), max_length=MAX_ENTRIES, description="a list of .binary or .bsdf files or builtin:NAME"
    )
    scene: SceneSection = section(SceneSection)
    metric: Annotated[str, AfterValidator(one_of(RESIDUALS))] = Field("light", description=listed(RESIDUALS))
    executor: Annotated[
        LocalExecutor | DaskExecutor, Field(discriminator="kind"), BeforeValidator(_kind_alone)
    ] = Field(
        LocalExecutor(),
        description="local, dask, or {kind: dask, scheduler: tcp://host:8786, workers: 2, wait_seconds: 60}",
    )
    budget: Budget = section(Budget)
    search: Search = section(Search)
    fit: FitSection = section(FitSection)
    culling: Number = number(0.01, low=0)
    baselines: Annotated[
        tuple[Annotated[str, AfterValidator(one_of(BASELINES))], ...], AfterValidator(check_no_baseline_twice)
    ] = Field(DEFAULT_BASELINES, max_length=MAX_ENTRIES, description=f"a list of {listed(BASELINES)}")

    _folder: Path = PrivateAttr(default_factory=Path.cwd)

    def model_post_init(self, context: Surroundings | None) -> None:
        if context is not None:
            self._folder = context.folder

    @property
    def folder(self) -> Path:
        """What relative paths in it count from: where the file lies."""
        return self._folder

    def text(self) -> str:
        """YAML with every default filled in, keys in one order; it loads back to an equal configuration."""
        return self._yaml()

    def _yaml(self, exclude: frozenset[str] = frozenset()) -> str:
        content = self.model_dump(mode="json", exclude=set(exclude))
        # YAML 1.1 counts these as line breaks, which a file's name may hold: then all but ASCII is escaped.
        texts = json.dumps(content, ensure_ascii=False)
        breaks = any(character in texts for character in "\x85\u2028\u2029")
        return yaml.safe_dump(
            content, sort_keys=False, default_flow_style=None, width=110, allow_unicode=not breaks
        )

    @cached_property
    def sha256(self) -> str:
        """Of `text()` without the keys of `FINDS_THE_SAME`; in hexadecimal."""
        return hashlib.sha256(self._yaml(exclude=FINDS_THE_SAME).encode()).hexdigest()

    @property
    def material_names(self) -> tuple[str, ...]:
        """What the materials are called."""
        return tuple(map(material_name, self.materials))

    @property
    def test_material_names(self) -> tuple[str, ...]:
        """What the test materials are called."""
        return tuple(map(material_name, self.test_materials))

    def start_expressions(self) -> tuple[Expression, ...]:
        return self.search.start_expressions()

    def codebank_expressions(self) -> tuple[Expression, ...]:
        return self.search.codebank_expressions()

    def differences(self, other: "Configuration") -> list[Difference]:
        """Every key in which this configuration (`here`) and another (`there`) differ; lists are one value."""
        return differences(self.model_dump(), other.model_dump())

    def conflicts(self, other: "Configuration") -> list[Difference]:
        """The differences because of which a run of `other` cannot go on under this configuration."""
        return [difference for difference in self.differences(other) if not difference.extends]

    def extends(self, other: "Configuration") -> bool:
        """Whether a run of `other` may go on under this one: what it has found stays, see `Difference.extends`."""
        return not self.conflicts(other)
