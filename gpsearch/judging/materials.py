"""A material as a user names it beside a run: one that it was searched on, a test material, or a new one."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from gpsearch.configuration import Configuration
from gpsearch.configuration.files import resolve_path
from gpsearch.configuration.materials import BUILTIN, material_name
from gpsearch.errors import GpsearchError

Role = Literal["training", "test", "new"]


@dataclass(frozen=True)
class NamedMaterial:
    """`reference` is a built-in one or a whole path; `role` is what the material is to the run."""

    name: str
    reference: str
    role: Role


def named_material(text: str, configuration: Configuration) -> NamedMaterial:
    """The material that a name or a reference of the run means, a file of it under another path, or a new one.

    Raises `GpsearchError` for what is neither of the run, a file, nor a built-in, or has a name of the run's.
    """
    known = materials_of_run(configuration)
    for one, reference in known.items():
        if text in (one.name, reference) or _whole(text, Path.cwd()) == one.reference:
            return one
    new = NamedMaterial(material_name(text), _whole(text, Path.cwd()), "new")
    if not text.startswith(BUILTIN) and not Path(new.reference).exists():
        names = ", ".join(one.name for one in known)
        raise GpsearchError(
            f"--material {text}: there is no such file, and the run has models of {names}; name one of these,"
            f" a file or {BUILTIN}NAME"
        )
    require_different_names([*known, new])
    return new


def materials_of_run(configuration: Configuration) -> dict[NamedMaterial, str]:
    """What the run was searched on, then its test materials, each with its reference in the configuration."""
    roles: tuple[tuple[Role, tuple[str, ...]], ...] = (
        ("training", configuration.materials),
        ("test", configuration.test_materials),
    )
    return {
        NamedMaterial(material_name(reference), _whole(reference, configuration.folder), role): reference
        for role, references in roles
        for reference in references
    }


def require_different_names(materials: Iterable[NamedMaterial]) -> None:
    """Raises `GpsearchError` where two are called the same, or one is named twice."""
    named: dict[str, NamedMaterial] = {}
    for one in materials:
        if (other := named.setdefault(one.name, one)) is not one:
            alike = "is named twice" if one.reference == other.reference else f"is called as {other.reference} is"
            raise GpsearchError(f"--material {one.reference} {alike}; name each once, under a name of its own")


def _whole(reference: str, folder: Path) -> str:
    return reference if reference.startswith(BUILTIN) else str(resolve_path(reference, folder.absolute()))
