"""A Mitsuba scene file and all files that it names, as one content hash."""

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

from fitters import cache
from fitters.errors import FittersError


def content_sha256(path: Path) -> str:
    """Content hash of a scene file and of every file that it names: included scenes, meshes, textures.

    A name in an attribute counts from the scene's folder or from that of a `<path>` element; parameters have their
    default values. Raises `FittersError` for a file that is not XML.
    """
    return cache.digest(*(file.read_bytes() for file in _files(path, set())))


def _files(path: Path, seen: set[Path]) -> Iterator[Path]:
    """The scene file and all files that belong to it, in the order in which they are named, each once."""
    if (identity := path.resolve()) in seen:
        return
    seen.add(identity)
    yield path
    if path.suffix.lower() != ".xml":
        return
    try:
        elements = list(ElementTree.parse(path).iter())
    except ElementTree.ParseError as error:
        raise FittersError(f"{path}: is not well-formed XML ({error}); repair the scene file") from None
    folders = [path.parent, *(path.parent / e.get("value", "") for e in elements if e.tag == "path")]
    # Longer names first: $mesh must not replace the beginning of $mesh_file.
    defaults = sorted(
        ((e.get("name", ""), e.get("value", "")) for e in elements if e.tag == "default"),
        key=lambda default: -len(default[0]),
    )
    for element in elements:
        for value in element.attrib.values():
            for name, default in defaults:
                value = value.replace(f"${name}", default)
            for folder in folders:
                if value and _is_file(folder / value):
                    yield from _files(folder / value, seen)


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):
        # Most attributes are numbers and words; some cannot be paths.
        return False
