"""What a configuration refers to: measured materials, lights, catalogue names and expressions."""

import os
import re
import stat
from collections.abc import Callable, Collection, Mapping
from pathlib import Path

from pydantic import ValidationInfo

from fitters.errors import FittersError
from fitters.expressions import Expression, parse, to_text
from fitters.expressions.catalogue import CATALOGUE, Formula
from fitters.materials import builtin_names
from fitters.materials.loading import READERS
from fitters.scenes.lights import BUILT_IN
from fitters.scenes.scene import SPHERE
from gpsearch.configuration.fields import Surroundings, refuse_at
from gpsearch.configuration.wording import listed, nearest, plain, shown

BUILTIN = "builtin:"
LIGHT_SUFFIXES = (".hdr", ".exr")
SCENE_SUFFIXES = (".xml",)
PEM_SUFFIXES = (".pem", ".crt", ".cer", ".key")
"""Usual ones; a file may be called otherwise."""
LARGEST_PEM = 1_000_000
"""Bytes."""
ALL = "all"
GROUPS: Mapping[str, Callable[[Formula], bool]] = {
    ALL: lambda formula: True,
    "published-2013": lambda formula: formula.year <= 2013,
}
"""Codebank entries that stand for formulas of the catalogue: all, or what there was before the genBRDF paper."""
MAX_NODES = 1000
"""The size of the largest expression that a configuration may hold or a search may reach."""


def check_material(reference: str, info: ValidationInfo) -> str:
    """Validates a material's reference: a built-in name, or a file of a known kind that is there."""
    if reference.startswith(BUILTIN):
        known = [BUILTIN + name for name in builtin_names()]
        if reference not in known:
            near = nearest(reference, known)
            hint = f"did you mean {near}? " if near else ""
            raise ValueError(f"no built-in material {shown(reference)}; {hint}allowed: {listed(known)}")
        return reference
    return _file(reference, READERS, info, "write builtin:NAME for a built-in one")


def check_no_material_twice(references: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
    """Validates a list of materials, and test materials beside those that a search is on.

    The same file under two names is the same material. Two of one name could not be told apart; a stored run of an
    earlier version, which found nothing with them, may still name them.
    """
    surrounding = surroundings(info)
    before = info.data.get("materials", ()) if info.field_name == "test_materials" else ()
    places = [f"materials[{index}]" for index in range(len(before))]
    places += [f"{info.field_name}[{index}]" for index in range(len(references))]
    first: dict[str, str] = {}
    named: dict[str, str] = {}
    for reference, place in zip((*before, *references), places, strict=True):
        same = first.setdefault(_identity(reference, surrounding.folder), place)
        name = material_name(reference)
        alike = named.setdefault(name, place) if surrounding.check_files else place
        index = places.index(place) - len(before)
        if same != place:
            text = f"{shown(reference)} is {same} again; name each material once"
            raise refuse_at(index, reference, text)
        if alike != place:
            text = f"{shown(reference)} is called {shown(name)} as {alike} is; rename one of the files"
            raise refuse_at(index, reference, text)
    return references


def material_name(reference: str) -> str:
    """What a material is called: the stem of a file, the name of a built-in."""
    return reference.removeprefix(BUILTIN) if reference.startswith(BUILTIN) else Path(reference).stem


def _identity(reference: str, folder: Path) -> str:
    """The same for two references to the same material."""
    return reference if reference.startswith(BUILTIN) else os.path.realpath(resolve_path(reference, folder))


def check_no_baseline_twice(names: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
    """Validates the list of baselines, but for that of a stored run: earlier versions let it pass."""
    for index, name in enumerate(names):
        if name in names[:index] and surroundings(info).check_files:
            text = f"{shown(name)} is baselines[{names.index(name)}] again; name each baseline once"
            raise refuse_at(index, name, text)
    return names


def check_light(reference: str, info: ValidationInfo) -> str:
    """Validates a light: a built-in name, or a latitude-longitude map that is there."""
    if reference in BUILT_IN:
        return reference
    near = nearest(reference, BUILT_IN)
    hint = f"did you mean {near}?" if near else f"built-in lights are {listed(BUILT_IN)}"
    return _file(reference, LIGHT_SUFFIXES, info, hint)


def check_geometry(reference: str, info: ValidationInfo) -> str:
    """Validates a geometry: the built-in sphere, or a scene file that is there."""
    if reference == SPHERE:
        return reference
    return _file(reference, SCENE_SUFFIXES, info, f"the built-in geometry is {SPHERE}")


def pem_file(content: str) -> Callable[[str, ValidationInfo], str]:
    """A validator of the path of a PEM file which holds `content`: `CERTIFICATE`, `PRIVATE KEY`."""

    def check(reference: str, info: ValidationInfo) -> str:
        hint = "check the path"
        path = _path(reference, PEM_SUFFIXES, info, hint)
        if not surroundings(info).check_files:
            return reference
        try:
            with path.open("rb") as file:
                text = file.read(LARGEST_PEM)
        except OSError as error:
            raise ValueError(f"{plain(str(path))} cannot be read ({error.strerror}); {hint}") from None
        if not re.search(rb"-----BEGIN ([A-Z]+ )?%s-----" % content.encode(), text):
            raise ValueError(f"{plain(str(path))} has no line -----BEGIN {content}-----; name a file in PEM form")
        return reference

    return check


def resolve_path(reference: str, folder: Path) -> Path:
    """The path of a file's reference, which counts from `folder` where it is relative."""
    return Path(os.path.normpath(folder / os.path.expanduser(reference)))


def _file(reference: str, suffixes: Collection[str], info: ValidationInfo, hint: str) -> str:
    if _path(reference, suffixes, info, hint).suffix.lower() not in suffixes:
        raise ValueError(f"{shown(reference)} does not end in {' or '.join(suffixes)}; {hint}")
    return reference


def _path(reference: str, suffixes: Collection[str], info: ValidationInfo, hint: str) -> Path:
    """The path of a file that is there, where files are looked for; `suffixes` and `hint` are for the error."""
    if not reference or "\0" in reference:
        raise ValueError(f"{shown(reference)} is no path; name a file {listed(suffixes)}")
    path = resolve_path(reference, surroundings(info).folder)
    if surroundings(info).check_files:
        _check_there(path, suffixes, hint)
    return path


def _check_there(path: Path, suffixes: Collection[str], hint: str) -> None:
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        raise ValueError(f"no file {plain(str(path))}; {_beside(path, suffixes) or hint}") from None
    except OSError as error:
        raise ValueError(f"{plain(str(path))} cannot be read ({error.strerror}); check the path") from None
    if not stat.S_ISREG(mode):
        kind = "a folder" if stat.S_ISDIR(mode) else "not a regular file"
        raise ValueError(f"{plain(str(path))} is {kind}; name a file {listed(suffixes)}")


def _beside(path: Path, suffixes: Collection[str]) -> str:
    """The file in the same folder that was probably meant, or what is wrong with the folder."""
    try:
        names = sorted(name for name in os.listdir(path.parent) if Path(name).suffix.lower() in suffixes)
    except OSError as error:
        return f"its folder cannot be listed ({error.strerror}); check the path" if path.parts[1:] else ""
    near = nearest(path.name, names)
    return f"did you mean {plain(near)}?" if near else ""


def surroundings(info: ValidationInfo) -> Surroundings:
    """Where a configuration is made by a program, paths count from the working folder and are not looked for."""
    return info.context or Surroundings(Path.cwd(), check_files=False)


def check_formula(entry: str, info: ValidationInfo) -> str:
    """Validates a catalogue name or an expression within the search's limits; an expression in canonical form.

    Limits that are themselves invalid, and so not in `info.data`, are not applied.
    """
    expression = resolve_formula(entry)
    if (parameters := info.data.get("parameters")) is not None:
        beyond = [name for name in expression.parameters if int(name[1:]) >= parameters]
        if beyond:
            may = "only p0" if parameters == 1 else f"p0 to p{parameters - 1}"
            limit = f"search.parameters is {parameters}: {may} may occur"
            raise ValueError(f"{shown(entry)} uses {listed(beyond)}, but {limit}")
    is_start = info.field_name == "start"
    largest = info.data.get("max_nodes", MAX_NODES) if is_start else MAX_NODES
    if expression.nodes > largest:
        limit = "search.max_nodes is" if is_start else "the most is"
        raise ValueError(f"{shown(entry)} has {expression.nodes} nodes, but {limit} {largest}")
    return entry if entry in CATALOGUE else to_text(expression)


def check_codebank(entry: str, info: ValidationInfo) -> str:
    """As `check_formula`; the name of one of `GROUPS` is valid, too."""
    if entry in GROUPS:
        return entry
    if (near := nearest(entry, GROUPS, cutoff=0.8)) and entry not in CATALOGUE:
        raise ValueError(f"{shown(entry)} is no group of the catalogue; did you mean {near}?")
    return check_formula(entry, info)


def resolve_formula(entry: str) -> Expression:
    """The expression of a catalogue name or a text form. Raises `ValueError` with why it is neither."""
    if entry in CATALOGUE:
        return CATALOGUE[entry].expression
    try:
        return parse(entry)
    except FittersError as error:
        near = nearest(entry, CATALOGUE)
        hint = f"did you mean {near}?" if near else f"there are {listed(CATALOGUE)}"
        split = entry.count("(") != entry.count(")")
        quote = "; an expression with a comma needs quotes in [...]" if split else ""
        reason = f"no catalogue name ({hint}) and no expression ({error})"
        raise ValueError(f"{shown(entry)} is {reason}{quote}") from None
