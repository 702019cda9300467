"""References to files: lights, scene files, certificates and keys, and the configuration itself."""

import os
import re
import stat
from collections.abc import Callable, Collection
from pathlib import Path

from pydantic import ValidationInfo

from fitters.scenes.lights import BUILT_IN
from fitters.scenes.scene import SPHERE
from gpsearch.configuration.fields import surroundings
from gpsearch.configuration.wording import listed, nearest, plain, shown
from gpsearch.errors import GpsearchError

LARGEST_FILE = 1_000_000
"""Bytes of a configuration or of a PEM file."""
LIGHT_SUFFIXES = (".hdr", ".exr")
SCENE_SUFFIXES = (".xml",)
PEM_SUFFIXES = (".pem", ".crt", ".cer", ".key")
"""The usual suffixes, for hints; others are allowed."""
YAML_SUFFIXES = (".yaml", ".yml")


def read_text(path: Path) -> str:
    """The text of a configuration file: an existing regular file in UTF-8, at most `LARGEST_FILE` bytes.

    Raises `GpsearchError` with the path and what is wrong.
    """
    name = plain(str(path))
    try:
        mode = path.stat().st_mode
        if not stat.S_ISREG(mode):
            raise GpsearchError(f"{name}: is {_kind(mode)}; name a configuration file in YAML")
        with path.open("rb") as file:
            content = file.read(LARGEST_FILE + 1)
    except (FileNotFoundError, NotADirectoryError):
        raise GpsearchError(f"{name}: no such file; {_hint(path, YAML_SUFFIXES) or 'check the path'}") from None
    except OSError as error:
        raise GpsearchError(f"{name}: cannot be read ({error.strerror}); check the path") from None
    except ValueError as error:
        if isinstance(error, GpsearchError):
            raise
        raise GpsearchError(f"{name}: is no path ({error})") from None
    if len(content) > LARGEST_FILE:
        raise GpsearchError(f"{name}: holds more than {LARGEST_FILE:,} bytes; is it a configuration?")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise GpsearchError(f"{name}:{line}: byte {error.start} is not UTF-8; save it as UTF-8") from None


def resolve_path(reference: str, folder: Path) -> Path:
    """The path of a file's reference, which counts from `folder` where it is relative."""
    return Path(os.path.normpath(folder / os.path.expanduser(reference)))


def check_light(reference: str, info: ValidationInfo) -> str:
    """Validates a light: a built-in name, or a latitude-longitude map that exists."""
    if reference in BUILT_IN:
        return reference
    near = nearest(reference, BUILT_IN)
    hint = f"did you mean {near}?" if near else f"built-in lights are {listed(BUILT_IN)}"
    return check_file(reference, LIGHT_SUFFIXES, info, hint)


def check_geometry(reference: str, info: ValidationInfo) -> str:
    """Validates a geometry: the built-in sphere, or a scene file that exists."""
    if reference == SPHERE:
        return reference
    return check_file(reference, SCENE_SUFFIXES, info, f"the built-in geometry is {SPHERE}")


def pem_file(content: str) -> Callable[[str, ValidationInfo], str]:
    """A validator of the path of a PEM file that holds `content`: `CERTIFICATE` or `PRIVATE KEY`."""

    def check(reference: str, info: ValidationInfo) -> str:
        hint = "check the path"
        path = _path(reference, PEM_SUFFIXES, info, hint)
        if not surroundings(info).check_files:
            return reference
        try:
            with path.open("rb") as file:
                text = file.read(LARGEST_FILE)
        except OSError as error:
            raise ValueError(f"{plain(str(path))} cannot be read ({error.strerror}); {hint}") from None
        if not re.search(rb"-----BEGIN ([A-Z]+ )?%s-----" % content.encode(), text):
            raise ValueError(f"{plain(str(path))} has no line -----BEGIN {content}-----; name a file in PEM form")
        return reference

    return check


def check_file(reference: str, suffixes: Collection[str], info: ValidationInfo, hint: str) -> str:
    """Validates the reference of an existing file with one of the suffixes; `hint` ends the error's message."""
    if _path(reference, suffixes, info, hint).suffix.lower() not in suffixes:
        raise ValueError(f"{shown(reference)} does not end in {' or '.join(suffixes)}; {hint}")
    return reference


def _path(reference: str, suffixes: Collection[str], info: ValidationInfo, hint: str) -> Path:
    """The path of a reference. It must exist, except where the configuration is read without its files."""
    if not reference or "\0" in reference:
        raise ValueError(f"{shown(reference)} is no path; name a file {listed(suffixes)}")
    path = resolve_path(reference, surroundings(info).folder)
    name = plain(str(path))
    if not surroundings(info).check_files:
        return path
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        raise ValueError(f"no file {name}; {_hint(path, suffixes) or hint}") from None
    except OSError as error:
        raise ValueError(f"{name} cannot be read ({error.strerror}); check the path") from None
    if not stat.S_ISREG(mode):
        raise ValueError(f"{name} is {_kind(mode)}; name a file {listed(suffixes)}")
    return path


def _kind(mode: int) -> str:
    return "a folder" if stat.S_ISDIR(mode) else "not a regular file"


def _hint(path: Path, suffixes: Collection[str]) -> str:
    """The file of the same folder that was probably meant, or why the folder has none to name."""
    try:
        names = sorted(name for name in os.listdir(path.parent) if Path(name).suffix.lower() in suffixes)
    except OSError as error:
        return f"its folder cannot be listed ({error.strerror}); check the path" if path.parts[1:] else ""
    near = nearest(path.name, names)
    return f"did you mean {plain(near)}?" if near else ""
