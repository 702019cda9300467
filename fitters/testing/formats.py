"""The contract of material formats: `check_format` asserts what every entry of `FORMATS` must do.

    from fitters.testing.formats import check_format
    check_format(merl.FORMAT, content, lambda w_i, w_o: ...)

`content` is a whole file of a material whose BRDF is known, not written by the code of the format itself.
"""

import hashlib
import re
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fitters.errors import FittersError
from fitters.grid import SHAPE, Array, above_horizon, cell_directions
from fitters.materials import AnisotropicMaterial, Material, is_anisotropic, load_anisotropic, load_material
from fitters.materials.material_file import HEAD_BYTES, Format
from fitters.materials.utia import sample_directions

Brdf = Callable[[Array, Array], Array]
"""(n, 3) in sr^-1 of unit directions w_i and w_o (n, 3)."""

ADVICE = re.compile(r"\b(fetch|check|choose|name|copy|look for|write)\b", re.IGNORECASE)
"""What an error tells a user to do begins with one of these words."""


def check_format(
    form: Format, content: bytes, brdf: Brdf, *, valid: NDArray[np.bool_] | None = None, rtol: float = 1e-5
) -> None:
    """All checks; raises `AssertionError` that names the format and what it does wrong.

    brdf:  what the file holds; `rtol` is how near to it the format's own grid lets a table come
    valid: (90, 90, 180) the cells that the file has measured; None for all above the horizon
    """
    with tempfile.TemporaryDirectory() as folder:
        check_name(form)
        check_content(form, content, brdf, valid, rtol, Path(folder))
        check_recognition(form, content, Path(folder))
        check_damage(form, content, Path(folder))


def check_name(form: Format) -> None:
    """It has a name, and a suffix in small letters with its dot."""
    assert form.name.strip(), "a format needs a name for messages"
    assert re.fullmatch(r"\.[a-z0-9]+", form.suffix), f"{form.name}: {form.suffix!r} is not like .binary"


def check_content(
    form: Format, content: bytes, brdf: Brdf, valid: NDArray[np.bool_] | None, rtol: float, folder: Path
) -> None:
    """Shape, unit and mask come out as they went in; the material has the file's name, hash and source."""
    path = _written(folder / f"sample{form.suffix}", content)
    material = _load(form, path)
    again = _load(form, path)
    assert np.array_equal(material.table, again.table), f"{form.name}: two readings of one file differ"
    assert material.name == "sample", f"{form.name}: the material is called {material.name}, not as its file"
    assert material.sha256 == hashlib.sha256(content).hexdigest(), f"{form.name}: the hash is not that of the file"
    assert form.name in material.source, f"{form.name}: its source does not name the format: {material.source}"
    if isinstance(material, Material):
        mask = above_horizon() if valid is None else valid
        assert np.array_equal(material.valid, mask), (
            f"{form.name}: other cells are valid than those that were measured"
        )
        assert material.table.shape == (3, *SHAPE), f"{form.name}: a table of shape {material.table.shape}"
        w_i, w_o = (w[mask.ravel()] for w in cell_directions())
        values = material.table.reshape(3, -1)[:, mask.ravel()].T
    else:
        w_i, w_o = sample_directions()
        values = material.table.reshape(3, -1).T
    assert material.table.dtype == np.float32, f"{form.name}: a table of {material.table.dtype}"
    np.testing.assert_allclose(values, brdf(w_i, w_o), rtol=rtol, err_msg=f"{form.name}: not the BRDF in sr^-1")


def check_recognition(form: Format, content: bytes, folder: Path) -> None:
    """Its files are recognised by content whatever they are called, and its kind by the name alone."""
    assert form.recognises(content[:HEAD_BYTES], len(content)), f"{form.name}: does not recognise its own file"
    assert not form.recognises(b"<!DOCTYPE html>", 15), f"{form.name}: recognises a web page"
    path = _written(folder / "renamed.dat", content)
    assert is_anisotropic(path) == form.anisotropic, f"{form.name}: its kind is not recognised"
    assert _load(form, path).name == "renamed", f"{form.name}: a file of another name is not read"
    absent = folder / f"absent{form.suffix}"
    assert is_anisotropic(absent) == form.anisotropic, f"{form.name}: its kind is not known by the suffix"


def check_damage(form: Format, content: bytes, folder: Path) -> None:
    """An empty, truncated or foreign file gives a `FittersError` that names it and says what to do."""
    cut = {f"the first {length:,} bytes": content[:length] for length in (1, HEAD_BYTES, len(content) // 2)}
    damaged = {
        "nothing": b"",
        **cut,
        "all but a byte": content[:-1],
        "a web page": b"<!DOCTYPE html><html></html>",
    }
    foreign = b"\xa5" * HEAD_BYTES + content[HEAD_BYTES:]
    if not form.recognises(foreign[:HEAD_BYTES], len(foreign)):
        damaged["another magic number"] = foreign
    for what, held in damaged.items():
        path = _written(folder / f"damaged{form.suffix}", held)
        said = ""
        try:
            _load(form, path)
        except FittersError as error:
            said = str(error)
        assert said, f"{form.name}: a file that holds {what} is read without an error"
        assert path.name in said, f"{form.name}: the error for {what} does not name the file: {said}"
        assert ADVICE.search(said), f"{form.name}: the error for {what} does not say what to do: {said}"


def _load(form: Format, path: Path) -> Material | AnisotropicMaterial:
    return load_anisotropic(path) if form.anisotropic else load_material(path)


def _written(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path
