"""The sections of a configuration. Defaults are from section 4 of the genBRDF paper where it has them."""

import dataclasses
import re
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self, get_type_hints

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    ValidationInfo,
    create_model,
    field_validator,
    model_validator,
)

from fitters.expressions import Expression
from fitters.fitting.settings import BOUNDS, CELLS, CONFIRM_CELLS, FitSettings
from fitters.scenes import Scene
from fitters.scenes.scene import SPHERE
from gpsearch.configuration.fields import Number, Section, Whole, number, section, surroundings, whole
from gpsearch.configuration.files import check_geometry, check_light, pem_file, resolve_path
from gpsearch.configuration.formulas import (
    ALL,
    GROUPS,
    MAX_NODES,
    check_codebank,
    check_formula,
    resolve_codebank,
    resolve_formula,
)
from gpsearch.configuration.wording import listed, shown
from workers import EXECUTORS, DaskSettings, ExecutorSettings, LocalSettings, Tls

MAX_ENTRIES = 1000
"""Entries of any list."""


def _as_list(value: Any) -> Any:
    return [value] if isinstance(value, str) else value


class SceneSection(Section):
    """The arguments of `fitters.scenes.Scene`."""

    light: Annotated[str, AfterValidator(check_light)] = Field(
        Scene.light, description="studio, overcast, or the path of a .hdr or .exr file"
    )
    rotation: Number = number(Scene.rotation)
    resolution: Whole = whole(Scene.resolution, 1, 1024)
    light_rows: Whole = whole(Scene.light_rows, 2, 1024)
    geometry: Annotated[str, AfterValidator(check_geometry)] = Field(
        Scene.geometry, description="sphere, or the path of a Mitsuba scene file .xml"
    )
    shape: str | None = Field(Scene.shape, min_length=1, description="the id of a shape in the file, or null")
    shadows: bool = Field(Scene.shadows, strict=True, description="true or false")

    @field_validator("shape", "shadows")
    @classmethod
    def _of_a_scene_file(cls, value: Any, info: ValidationInfo) -> Any:
        if info.data.get("geometry") == SPHERE and value != getattr(Scene, str(info.field_name)):
            raise ValueError(f"found {shown(value)}, which is for a scene file; remove it or name one as geometry")
        return value

    @property
    def recipe(self) -> Scene:
        """The scene; relative paths of its light and geometry count from the configuration's folder."""
        return Scene(**self.model_dump())


class ExecutorSection(Section):
    """The options of one kind of executor of `workers.EXECUTORS`."""

    executor: ClassVar[type[ExecutorSettings]]
    kind: str

    def settings(self, folder: Path) -> ExecutorSettings:
        """The argument of `workers.open_executor`; relative paths count from `folder`."""
        return self.executor(**self.model_dump(exclude={"kind"}))


class LocalExecutorSection(ExecutorSection):
    """One process."""

    executor = LocalSettings
    kind: Literal["local"] = "local"


class TlsSection(Section):
    """The PEM files by which launcher, scheduler and workers identify each other, with any suffix.

    ca:   of the certificate authority that issued the certificates of all of them
    cert: the launcher's certificate
    key:  the private key of `cert`, without a passphrase
    """

    ca: Annotated[str, AfterValidator(pem_file("CERTIFICATE"))] = Field(
        description="the path of a certificate authority's PEM file"
    )
    cert: Annotated[str, AfterValidator(pem_file("CERTIFICATE"))] = Field(
        description="the path of a certificate's PEM file"
    )
    key: Annotated[str, AfterValidator(pem_file("PRIVATE KEY"))] = Field(
        description="the path of a private key's PEM file"
    )


class DaskExecutorSection(ExecutorSection):
    """A running scheduler, or without one a cluster on this machine that ends with the run.

    workers:      processes to start on this machine, one per core by default
    wait_seconds: how long to wait for a scheduler and a first worker, at the start and when they are lost later
    hang_seconds: a task hangs when it takes longer than this, and longer than 30 times its expected time
    tls:          for a scheduler at a tls:// address
    """

    executor = DaskSettings
    kind: Literal["dask"] = "dask"
    scheduler: str | None = Field(None, description="an address such as tcp://host:8786, or null")
    workers: Whole | None = whole(None, 1, 100_000, nullable=True)
    wait_seconds: Number = number(60.0, low=0)
    hang_seconds: Number = number(60.0, above=0)
    tls: TlsSection | None = section(TlsSection, nullable=True)

    def settings(self, folder: Path) -> DaskSettings:
        """As `ExecutorSection.settings`."""
        files = self.tls
        tls = Tls(*(resolve_path(file, folder) for file in (files.ca, files.cert, files.key))) if files else None
        return DaskSettings(self.scheduler, self.workers, self.wait_seconds, self.hang_seconds, tls)

    @field_validator("scheduler")
    @classmethod
    def _address(cls, value: str | None) -> str | None:
        address = re.compile(r"((tcp|tls|ucx|ws|wss)://)?([\w.-]+|\[[0-9a-fA-F:.%]+\]):[0-9]{1,5}/?", re.ASCII)
        if value is not None and not address.fullmatch(value):
            raise ValueError(f"found {shown(value)}; allowed: an address such as tcp://host:8786, or null")
        return value

    @field_validator("tls")
    @classmethod
    def _of_the_scheduler(cls, value: TlsSection | None, info: ValidationInfo) -> TlsSection | None:
        if "scheduler" not in info.data:
            return value
        scheduler = info.data["scheduler"]
        encrypted = scheduler is not None and scheduler.startswith("tls://")
        if value is not None and scheduler is None:
            raise ValueError("is for a running scheduler, processes of this machine need none; remove it")
        if value is not None and not encrypted:
            raise ValueError(f"needs a tls:// scheduler, found {shown(scheduler)}; write tls:// or remove tls")
        # A stored run may have no `tls`, where Dask's own configuration named the files.
        if value is None and encrypted and surroundings(info).check_files:
            keys = listed(TlsSection.model_fields)
            raise ValueError(f"is missing, which {shown(scheduler)} needs; allowed: a mapping of the keys {keys}")
        return value


def executor_section(executor: type[ExecutorSettings]) -> type[ExecutorSection]:
    """The section of an executor that needs no checks but of types: its keys are the fields of its settings."""
    types = get_type_hints(executor)
    options: dict[str, Any] = {
        option.name: (types[option.name], Field(option.default, description=f"{option.name} of {executor.kind}"))
        for option in dataclasses.fields(executor)  # type: ignore[arg-type]
    }
    kind: Any = (Literal[executor.kind], executor.kind)
    section = create_model(f"{executor.__name__}Section", __base__=ExecutorSection, kind=kind, **options)
    section.executor = executor
    return section


OTHER_EXECUTORS = tuple(
    executor_section(kind) for kind in EXECUTORS.values() if kind not in (LocalSettings, DaskSettings)
)


class BudgetSection(Section):
    """When a run ends: at the limit that it reaches first."""

    generations: Whole | None = whole(100, 1, nullable=True)
    minutes: Number | None = number(None, above=0, nullable=True)
    candidates: Whole | None = whole(None, 1, nullable=True)

    @model_validator(mode="after")
    def _some_limit(self) -> Self:
        if self.generations is self.minutes is self.candidates is None:
            raise ValueError("every limit is null, the run would not end; give one of them a number")
        return self


class EditsSection(Section):
    """Relative frequencies of the edits of the genBRDF paper's section 3.3."""

    swap: Number = number(1.0, low=0)
    insert: Number = number(1.0, low=0)
    replace: Number = number(1.0, low=0)
    delete: Number = number(1.0, low=0)

    @model_validator(mode="after")
    def _some_edit(self) -> Self:
        if not any((self.swap, self.insert, self.replace, self.delete)):
            raise ValueError("every frequency is 0, there would be no edits; give one more than 0")
        return self


class SearchSection(Section):
    """How formulas are bred. Pydantic validates fields in order: limits come before the fields that they apply to.

    parameters:    p0 to p{parameters - 1} may occur
    bounds:        of every parameter
    migrate_every: generations between migrations, when an island sends its best `migrants` to the next island
    """

    parameters: Whole = whole(4, 1, 8)
    max_nodes: Whole = whole(120, 5, MAX_NODES)
    bounds: tuple[Number, Number] = Field(BOUNDS, description="two finite numbers [low, high]")
    start: Annotated[tuple[Annotated[str, AfterValidator(check_formula)], ...], BeforeValidator(_as_list)] = Field(
        ("cook-torrance",),
        min_length=1,
        max_length=MAX_ENTRIES,
        description="at least one catalogue name or expression",
    )
    codebank: Annotated[tuple[Annotated[str, AfterValidator(check_codebank)], ...], BeforeValidator(_as_list)] = (
        Field(
            (ALL,),
            min_length=1,
            max_length=MAX_ENTRIES,
            description=f"at least one catalogue name or expression, or group of them: {listed(GROUPS)}",
        )
    )
    islands: Whole = whole(4, 1, 10_000)
    island_size: Whole = whole(1024, 4, 1_000_000)
    tournament: Whole = whole(8, 1, 1_000_000)
    migrate_every: Whole = whole(5, 1)
    migrants: Whole = whole(1, 0, 1_000_000)
    edits: EditsSection = section(EditsSection)

    @field_validator("bounds")
    @classmethod
    def _rising(cls, value: tuple[float, float]) -> tuple[float, float]:
        if not value[0] < value[1]:
            raise ValueError(f"found {shown(value)}; allowed: [low, high] with low < high")
        return value

    @field_validator("island_size")
    @classmethod
    def _even(cls, value: int) -> int:
        if value % 2:
            raise ValueError(f"found {value}; allowed: an even number, such as {value + 1}")
        return value

    @field_validator("migrants")
    @classmethod
    def _fewer_than_an_island(cls, value: int, info: Any) -> int:
        if value >= (size := info.data.get("island_size", value + 1)):
            raise ValueError(f"found {value}; allowed: fewer than search.island_size, which is {size}")
        return value

    def start_expressions(self) -> tuple[Expression, ...]:
        return tuple(resolve_formula(entry) for entry in self.start)

    def codebank_expressions(self) -> tuple[Expression, ...]:
        return resolve_codebank(self.codebank, self.parameters)


class FitSection(Section):
    """The settings of fits, `fitters.fitting.FitSettings`, and the number of cells.

    cells:          of the sample that every candidate is screened on
    confirm_cells:  of the sample that candidates for the front are confirmed on
    early_stopping: gives up fits that end far from the population's better third and from the front
    warm_starts:    a fit also starts from the parameters of the parent
    """

    cells: Whole = whole(CELLS, 64, 10_000_000)
    confirm_cells: Whole = whole(CONFIRM_CELLS, 64, 10_000_000)
    starts: Whole = whole(FitSettings.starts, 1, 1_000_000)
    restarts: Whole = whole(FitSettings.restarts, 1, 1_000_000)
    rounds: Whole = whole(FitSettings.rounds, 0, 1_000_000)
    evaluations: Whole = whole(FitSettings.evaluations, 1, 1_000_000)
    tolerance: Number = number(FitSettings.tolerance, above=0)
    early_stopping: bool = Field(True, strict=True, description="true or false")
    warm_starts: bool = Field(True, strict=True, description="true or false")

    @property
    def settings(self) -> FitSettings:
        return FitSettings(self.starts, self.restarts, self.rounds, self.evaluations, self.tolerance)
