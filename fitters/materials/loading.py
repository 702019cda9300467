"""From what a user writes, a path or `builtin:NAME`, to a material."""

import difflib
from collections.abc import Callable, Mapping
from pathlib import Path

from fitters.errors import FittersError
from fitters.materials import merl, rgl, synthetic, utia
from fitters.materials.material import Material
from fitters.materials.material_file import MaterialFile, read_file
from fitters.materials.outliers import without_outliers
from fitters.materials.utia import AnisotropicMaterial

READERS: Mapping[str, Callable[[MaterialFile], Material]] = {".binary": merl.load, ".bsdf": rgl.load}
ANISOTROPIC_SUFFIX = ".bin"


def load_material(reference: str | Path, *, base: Path | None = None) -> Material:
    """The material that `reference` names: a MERL `.binary` or RGL `.bsdf` file, or `builtin:NAME`.

    A relative path counts from `base`, or from the working directory. Raises `FittersError` where there is no
    such file or built-in material, or where the file is damaged or of another kind. Spikes and dropouts of a file
    are taken for not measured, see `fitters.materials.outliers`.
    """
    if str(reference).startswith(synthetic.PREFIX):
        return synthetic.load(str(reference).removeprefix(synthetic.PREFIX))
    path = _path(reference, base)
    _check(path, str(reference))
    suffix = path.suffix.lower()
    if suffix == ANISOTROPIC_SUFFIX:
        raise FittersError(
            f"{path.name} is anisotropic by its name (a UTIA file), for which the grid of isotropic materials has "
            "no room: only `gpsearch fit power-iterations-anisotropic` takes it."
        )
    if suffix not in READERS:
        built_in = ", ".join(synthetic.PREFIX + name for name in synthetic.builtin_names())
        raise FittersError(
            f"{path.name} is no .binary file (MERL) and no .bsdf file (RGL), which its name would end in. "
            f"Name one of those, or {built_in}."
        )
    return without_outliers(READERS[suffix](read_file(path)))


def is_anisotropic(reference: str | Path) -> bool:
    """Whether a reference names an anisotropic measurement: a UTIA `.bin` file."""
    return not str(reference).startswith(synthetic.PREFIX) and Path(reference).suffix.lower() == ANISOTROPIC_SUFFIX


def load_anisotropic(reference: str | Path, *, base: Path | None = None) -> AnisotropicMaterial:
    """The measurement in a UTIA `.bin` file; otherwise as `load_material`."""
    path = _path(reference, base)
    _check(path, str(reference))
    return utia.load(read_file(path))


def _path(reference: str | Path, base: Path | None) -> Path:
    try:
        path = Path(reference).expanduser()
    except RuntimeError as error:
        raise FittersError(f"{reference} names the home folder of an unknown user: check the path.") from error
    return path if base is None else base / path


def _check(path: Path, reference: str) -> None:
    """Refuse what cannot be a material file, before anything is read."""
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
    try:
        wanted = (ANISOTROPIC_SUFFIX,) if is_anisotropic(path) else tuple(READERS)
        beside = sorted(p.name for p in path.parent.iterdir() if p.suffix.lower() in wanted)
    except (OSError, ValueError):
        return f" Its folder {path.parent} cannot be listed either: check the path."
    near = difflib.get_close_matches(path.name, beside, n=1, cutoff=0.5)
    if near:
        return f" Did you mean {near[0]}?"
    if beside:
        return f" {path.parent} holds {len(beside)} {' or '.join(wanted)} file(s), such as {beside[0]}."
    return f" {path.parent} holds no {' or '.join(wanted)} file: check the path."
