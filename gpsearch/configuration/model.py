"""The configuration of a run, valid and complete."""

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Union

import yaml
from pydantic import AfterValidator, BeforeValidator, Field, PrivateAttr

from fitters.fitting import RESIDUALS
from fitters.materials.formats import ISOTROPIC_SUFFIXES
from fitters.models import BASELINES
from gpsearch.configuration.fields import Number, Section, Surroundings, Whole, number, one_of, section, whole
from gpsearch.configuration.formulas import check_no_baseline_twice
from gpsearch.configuration.materials import check_material, check_no_material_twice, material_name
from gpsearch.configuration.sections import (
    MAX_ENTRIES,
    OTHER_EXECUTORS,
    BudgetSection,
    DaskExecutorSection,
    FitSection,
    LocalExecutorSection,
    SceneSection,
    SearchSection,
)
from gpsearch.configuration.wording import listed, shown
from workers import EXECUTORS

FILES = f"{' or '.join(ISOTROPIC_SUFFIXES)} file"
"""A file of a material, in messages."""
DEFAULT_BASELINES = (
    "cook-torrance",
    "ggx",
    "bivariate",
    "npf-independent-g",
    "npf-g-from-d",
    "npf-naive",
    "power-iterations",
)

NO_EFFECT_ON_RESULTS = frozenset({"executor", "test_materials"})
"""Keys that change neither the front nor the baselines."""


@dataclass(frozen=True)
class Difference:
    """A key whose value differs in two configurations; None in a configuration that does not have it."""

    key: str
    here: Any
    there: Any

    def __str__(self) -> str:
        return f"{self.key}: {shown(self.here)} instead of {shown(self.there)}"

    @property
    def extends(self) -> bool:
        """Whether a run of `there` may resume with `here`: with a larger budget, elsewhere, other tests."""
        if self.key.split(".")[0] in NO_EFFECT_ON_RESULTS:
            return True
        if not self.key.startswith("budget."):
            return False
        return self.here is None or (self.there is not None and self.here > self.there)


Materials = Annotated[
    tuple[Annotated[str, AfterValidator(check_material)], ...], AfterValidator(check_no_material_twice)
]
"""References of materials, no material twice."""


if TYPE_CHECKING:
    AnyExecutor = LocalExecutorSection | DaskExecutorSection
else:
    AnyExecutor = Union[LocalExecutorSection, DaskExecutorSection, *OTHER_EXECUTORS]


def _kind_alone(value: Any) -> Any:
    """`local` and `dask` are short for a mapping that has only the kind."""
    return {"kind": value} if isinstance(value, str) else value


class Configuration(Section):
    """Everything that decides a run's results, where it runs, and the materials that it is tested on.

    Frozen. Two configurations are equal if all keys and `folder` are.
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
        description=f"a list of at least one {FILES} or builtin:NAME",
    )
    test_materials: Materials = Field(
        (), max_length=MAX_ENTRIES, description=f"a list of {FILES}s or builtin:NAME"
    )
    scene: SceneSection = section(SceneSection)
    metric: Annotated[str, AfterValidator(one_of(RESIDUALS))] = Field("light", description=listed(RESIDUALS))
    executor: Annotated[AnyExecutor, Field(discriminator="kind"), BeforeValidator(_kind_alone)] = Field(
        LocalExecutorSection(),
        description=f"{listed(EXECUTORS)}, "
        "or {kind: dask, scheduler: tcp://host:8786, workers: 2, wait_seconds: 60}",
    )
    budget: BudgetSection = section(BudgetSection)
    search: SearchSection = section(SearchSection)
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
        """The folder of its file, from which its relative paths count."""
        return self._folder

    def text(self) -> str:
        """YAML with every key, defaults too, in a fixed order; it loads back to an equal configuration."""
        return self._yaml()

    def _yaml(self, exclude: frozenset[str] = frozenset()) -> str:
        content = self.model_dump(mode="json", exclude=set(exclude))
        # YAML 1.1 reads these as line breaks. A file's name may have them: then only ASCII is written as it is.
        texts = json.dumps(content, ensure_ascii=False)
        breaks = any(character in texts for character in "\x85\u2028\u2029")
        return yaml.safe_dump(
            content, sort_keys=False, default_flow_style=None, width=110, allow_unicode=not breaks
        )

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of `text()` without the keys of `NO_EFFECT_ON_RESULTS`, in hexadecimal."""
        return hashlib.sha256(self._yaml(exclude=NO_EFFECT_ON_RESULTS).encode()).hexdigest()

    @property
    def material_names(self) -> tuple[str, ...]:
        """The names of the materials."""
        return tuple(map(material_name, self.materials))

    @property
    def test_material_names(self) -> tuple[str, ...]:
        """The names of the test materials."""
        return tuple(map(material_name, self.test_materials))

    def differences(self, other: "Configuration") -> list[Difference]:
        """Every key in which this configuration (`here`) and another (`there`) differ; lists are one value."""
        here, there = dict(_leaves(self.model_dump())), dict(_leaves(other.model_dump()))
        keys = dict.fromkeys([*here, *there])
        pairs = ((key, here.get(key), there.get(key)) for key in keys)
        return [Difference(*pair) for pair in pairs if pair[1] != pair[2]]

    def conflicts(self, other: "Configuration") -> list[Difference]:
        """The differences because of which a run of `other` cannot resume with this configuration."""
        return [difference for difference in self.differences(other) if not difference.extends]

    def extends(self, other: "Configuration") -> bool:
        """Whether a run of `other` may resume with this configuration and keep its results."""
        return not self.conflicts(other)


def _leaves(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{prefix}{key}.")
        else:
            yield prefix + key, value
