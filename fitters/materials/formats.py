"""The registry of file formats, and the way from a reference, a path or `builtin:NAME`, to a material.

To add a format, write a module with a `Format` of its own and name it in `FORMATS`; the tests then run the suite
`fitters.testing.formats` on it.
"""

import difflib
from pathlib import Path

from fitters.errors import FittersError
from fitters.materials import merl, rgl, synthetic, utia
from fitters.materials.material import Material
from fitters.materials.material_file import HEAD_BYTES, Format, MaterialFile, read_file
from fitters.materials.outliers import without_outliers
from fitters.materials.utia import AnisotropicMaterial

FORMATS: tuple[Format, ...] = (merl.FORMAT, rgl.FORMAT, utia.FORMAT)
"""In the order in which they are asked whether they recognise a file: a format without a magic number is last."""

ISOTROPIC_SUFFIXES = tuple(form.suffix for form in FORMATS if not form.anisotropic)
"""The ends of the names of files that `load_material` takes."""


def load_material(reference: str | Path, *, base: Path | None = None) -> Material:
    """The material that `reference` names: a file of a registered format, or `builtin:NAME`.

    A file's format is recognised by its content, or else by the end of its name. A relative path counts from
    `base`, or from the working directory. Raises `FittersError` where there is no such file or built-in material,
    or where the file is damaged or of another kind. Spikes and dropouts of a file are taken for not measured, see
    `fitters.materials.outliers`.
    """
    if str(reference).startswith(synthetic.PREFIX):
        return synthetic.load(str(reference).removeprefix(synthetic.PREFIX))
    file = _file(reference, base)
    form = _format_of(file)
    material = form.load(file)
    if isinstance(material, AnisotropicMaterial):
        raise FittersError(
            f"{file.name} is anisotropic ({form.name} format): the table of an isotropic material cannot hold it, "
            "only `gpsearch fit power-iterations-anisotropic` takes it."
        )
    return without_outliers(material)


def load_anisotropic(reference: str | Path, *, base: Path | None = None) -> AnisotropicMaterial:
    """The measurement in a file of an anisotropic format; otherwise as `load_material`."""
    file = _file(reference, base)
    form = _format_of(file)
    material = form.load(file)
    if isinstance(material, Material):
        kinds = " or ".join(f"a {other.suffix} file ({other.name})" for other in FORMATS if other.anisotropic)
        raise FittersError(f"{file.name} is isotropic ({form.name} format): name {kinds}.")
    return material


def is_anisotropic(reference: str | Path) -> bool:
    """Whether a reference names a file of an anisotropic format; false where the file cannot be read."""
    if str(reference).startswith(synthetic.PREFIX):
        return False
    path = Path(reference)
    try:
        path = path.expanduser()
        with path.open("rb") as file:
            form = _recognised(file.read(HEAD_BYTES), path.stat().st_size)
    except (OSError, RuntimeError, ValueError):
        form = None
    form = form or _named(path)
    return form is not None and form.anisotropic


def _format_of(file: MaterialFile) -> Format:
    """The format of a file, by its content or else by its name. Raises `FittersError`."""
    form = _recognised(file.content[:HEAD_BYTES], len(file.content)) or _named(Path(file.name))
    if form is None:
        kinds = " and ".join(f"no {form.suffix} file ({form.name})" for form in FORMATS if not form.anisotropic)
        built_in = ", ".join(synthetic.PREFIX + name for name in synthetic.builtin_names())
        raise FittersError(
            f"{file.name} is {kinds}, neither by its content nor by the end of its name. Name one of those, or "
            f"{built_in}."
        )
    return form


def _recognised(head: bytes, size: int) -> Format | None:
    return next((form for form in FORMATS if form.recognises(head, size)), None)


def _named(path: Path) -> Format | None:
    return next((form for form in FORMATS if form.suffix == path.suffix.lower()), None)


def _file(reference: str | Path, base: Path | None) -> MaterialFile:
    """The file that a reference names; refused before it is read where it cannot be a material file."""
    try:
        path = Path(reference).expanduser()
    except RuntimeError as error:
        raise FittersError(f"{reference} names the home folder of an unknown user: check the path.") from error
    path = path if base is None else base / path
    _check(path, str(reference))
    return read_file(path)


def _check(path: Path, reference: str) -> None:
    try:
        exists, folder, regular = path.exists(), path.is_dir(), path.is_file()
    except (OSError, ValueError) as error:
        raise FittersError(f"{reference!r} cannot be used as a file name ({error}).") from error
    if not exists:
        raise FittersError(f"{path} does not exist.{_suggestion(path, reference)}")
    if folder:
        raise FittersError(f"{path} is a folder: name one material file.{_suggestion(path / 'a', reference)}")
    if not regular:
        raise FittersError(f"{path} is not a regular file: copy the material into a file and name that.")


def _suggestion(path: Path, reference: str) -> str:
    """A sentence that names what was probably meant: a built-in material or a file beside `path`."""
    near = difflib.get_close_matches(reference, synthetic.builtin_names(), n=1, cutoff=0.8)
    if near:
        return f" Did you mean {synthetic.PREFIX}{near[0]}?"
    named = _named(path)
    wanted = (named.suffix,) if named and named.anisotropic else ISOTROPIC_SUFFIXES
    try:
        beside = sorted(p.name for p in path.parent.iterdir() if p.suffix.lower() in wanted)
    except (OSError, ValueError):
        return f" Its folder {path.parent} cannot be listed either: check the path."
    near = difflib.get_close_matches(path.name, beside, n=1, cutoff=0.5)
    if near:
        return f" Did you mean {near[0]}?"
    if beside:
        return f" {path.parent} holds {len(beside)} {' or '.join(wanted)} file(s), such as {beside[0]}."
    return f" {path.parent} holds no {' or '.join(wanted)} file: check the path."
