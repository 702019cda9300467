"""From a file to a configuration, or to one error that lists all that is wrong with the file."""

import re
import stat
from pathlib import Path

from pydantic import ValidationError

from gpsearch.configuration.document import read_document
from gpsearch.configuration.fields import Surroundings
from gpsearch.configuration.model import Configuration
from gpsearch.configuration.problems import message, validation_problems
from gpsearch.configuration.wording import nearest, plain
from gpsearch.errors import GpsearchError

LARGEST_FILE = 1_000_000
"""Bytes."""


def load_configuration(path: Path) -> Configuration:
    """The configuration in a YAML file; relative paths in it count from the file's folder.

    Raises `GpsearchError`, a line per problem: file, line, key path, what was found and what is allowed.
    """
    path = Path(path)
    return parse_configuration(_read(path), source=plain(str(path)), folder=path.absolute().parent)


def parse_configuration(text: str, *, source: str, folder: Path, check_files: bool = True) -> Configuration:
    """The configuration in a YAML text. `source` names it in messages, and its stem the run by default.

    Relative paths count from `folder`. Without `check_files` the files of materials and lights need not be
    there, as when a finished run is read on another machine. Raises `GpsearchError` as `load_configuration`.
    """
    document = read_document(text, source)
    problems = list(document.problems)
    tree = {"name": _default_name(source), **document.tree}
    try:
        configuration = Configuration.model_validate(tree, context=Surroundings(folder, check_files))
    except ValidationError as error:
        problems += validation_problems(error, document)
    if problems:
        raise GpsearchError(message(problems, source))
    return configuration


def _default_name(source: str) -> str:
    """The file's stem, with a dash for what a name must not hold."""
    return re.sub(r"[^A-Za-z0-9._-]+", "-", Path(source).stem)[:100].lstrip(".-") or "run"


def _read(path: Path) -> str:
    """The text of a file that is there, of reasonable size and in UTF-8."""
    name = plain(str(path))
    try:
        mode = path.stat().st_mode
        if not stat.S_ISREG(mode):
            kind = "a folder" if stat.S_ISDIR(mode) else "not a regular file"
            raise GpsearchError(f"{name}: is {kind}; name a configuration file in YAML")
        with path.open("rb") as file:
            content = file.read(LARGEST_FILE + 1)
    except (FileNotFoundError, NotADirectoryError):
        raise GpsearchError(f"{name}: no such file{_beside(path)}") from None
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


def _beside(path: Path) -> str:
    """The YAML file in the same folder that was probably meant."""
    try:
        names = sorted(entry.name for entry in path.parent.iterdir() if entry.suffix in (".yaml", ".yml"))
    except OSError:
        return "; its folder cannot be listed either: check the path"
    near = nearest(path.name, names)
    return f"; did you mean {plain(near)}?" if near else "; check the path"
