"""References to materials: the path of a measurement, or `builtin:NAME`."""

import os
from pathlib import Path

from pydantic import ValidationInfo

from fitters.materials import builtin_names
from fitters.materials.formats import ISOTROPIC_SUFFIXES
from gpsearch.configuration.fields import refuse_at, surroundings
from gpsearch.configuration.files import check_file, resolve_path
from gpsearch.configuration.wording import listed, nearest, shown

BUILTIN = "builtin:"


def material_name(reference: str) -> str:
    """The name of a material: the stem of a file, the name of a built-in."""
    return reference.removeprefix(BUILTIN) if reference.startswith(BUILTIN) else Path(reference).stem


def check_material(reference: str, info: ValidationInfo) -> str:
    """Validates a material's reference: a built-in name, or an existing file of a known format."""
    if not reference.startswith(BUILTIN):
        return check_file(reference, ISOTROPIC_SUFFIXES, info, "write builtin:NAME for a built-in one")
    known = [BUILTIN + name for name in builtin_names()]
    if reference not in known:
        near = nearest(reference, known)
        hint = f"did you mean {near}? " if near else ""
        raise ValueError(f"no built-in material {shown(reference)}; {hint}allowed: {listed(known)}")
    return reference


def check_no_material_twice(references: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
    """Validates the list of materials, or the list of test materials together with the materials.

    A file under two paths is one material. Two materials of the same name are refused, because results name them;
    a stored run may hold such materials, as long as the same material does not occur twice.
    """
    surrounding = surroundings(info)
    before = info.data.get("materials", ()) if info.field_name == "test_materials" else ()
    places = [f"materials[{index}]" for index in range(len(before))]
    places += [f"{info.field_name}[{index}]" for index in range(len(references))]
    place_of_file: dict[str, str] = {}
    place_of_name: dict[str, str] = {}
    for index, (reference, place) in enumerate(zip((*before, *references), places, strict=True), -len(before)):
        earlier = place_of_file.setdefault(_identity(reference, surrounding.folder), place)
        if earlier != place:
            raise refuse_at(index, reference, f"{shown(reference)} is {earlier} again; name each material once")
        name = material_name(reference)
        earlier = place_of_name.setdefault(name, place)
        if earlier != place and surrounding.check_files:
            text = f"{shown(reference)} is called {shown(name)} as {earlier} is; rename one of the files"
            raise refuse_at(index, reference, text)
    return references


def _identity(reference: str, folder: Path) -> str:
    """The same text for two references to one material."""
    return reference if reference.startswith(BUILTIN) else os.path.realpath(resolve_path(reference, folder))
