"""Every registered format passes the contract suite, and the suite finds what it is there to find."""

import struct
from dataclasses import replace

import numpy as np
import pytest

from fitters.errors import FittersError
from fitters.grid import CELLS, above_horizon, cell_directions
from fitters.materials import formats, load_anisotropic, load_material
from fitters.materials.material_file import Format
from fitters.materials.utia import sample_directions
from fitters.testing import formats as suite

COLOUR = np.array([1.0, 2.0, 3.0])


def smooth(w_i, w_o):
    """Reciprocal, positive, of three colours."""
    return (0.1 + w_i[:, 2:] * w_o[:, 2:]) * COLOUR


def merl_file():
    """After Matusik et al. 2003: a header, planes of float64 in their own units; -1 stands for not measured."""
    values = smooth(*cell_directions()).T / (np.array([[1.0], [1.15], [1.66]]) / 1500)
    values[:, ~above_horizon().ravel()] = -1.0
    return struct.pack("<3i", 90, 90, 180) + values.astype("<f8").tobytes()


def rgl_file(tensor_bytes):
    """Constant radiance f cos(theta_o), visible normals spread evenly, D / (4 sigma) = 1."""
    x, _ = np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 5))
    rgb = np.stack([channel + 0 * x for channel in COLOUR])
    return tensor_bytes(
        {
            "theta_i": np.array([0, np.pi / 2], np.float32),
            "phi_i": np.zeros(1, np.float32),
            "ndf": np.full((2, 3), 2, np.float32),
            "sigma": np.full((2, 3), 0.5, np.float32),
            "vndf": np.ones((1, 2, 6, 9), np.float32),
            "rgb": np.stack([rgb, rgb])[None].astype(np.float32),
            "jacobian": np.ones(1, np.uint8),
        }
    )


def over_both_cosines(w_i, w_o):
    """The BRDF of `rgl_file`, the mean over both orders of the directions weighted with the cosine."""
    return 2 * COLOUR / (w_i[:, 2:] + w_o[:, 2:])


def utia_file():
    """After Filip and Vavra 2014: planes of 288 x 288 float64, light by view."""
    return smooth(*sample_directions()).T.astype("<f8").tobytes()


EXAMPLES = {
    "MERL": (lambda _: merl_file(), smooth),
    "RGL": (rgl_file, over_both_cosines),
    "UTIA": (lambda _: utia_file(), smooth),
}


def test_every_registered_format_has_an_example():
    assert [form.name for form in formats.FORMATS] == list(EXAMPLES)
    assert len({form.suffix for form in formats.FORMATS}) == len(formats.FORMATS)


@pytest.mark.parametrize("form", formats.FORMATS, ids=lambda form: form.name)
def test_registered_formats_pass(form, tensor_bytes):
    write, brdf = EXAMPLES[form.name]
    suite.check_format(form, write(tensor_bytes), brdf)


def raw(load, **changes):
    return replace(Format("raw", ".raw", lambda head, size: head.startswith(b"raw!"), load), **changes)


def constant(file):
    """Reads whatever it is given."""
    return formats.merl.from_samples(file.stem, np.full((3, 90, 90, 180), 0.5), source="raw", sha256=file.sha256)


def half(w_i, w_o):
    return np.full((len(w_i), 3), 0.5)


BROKEN = {
    "a suffix": (raw(constant, suffix="raw"), half, "is not like .binary"),
    "a unit": (raw(constant), lambda w_i, w_o: half(w_i, w_o) / np.pi, "not the BRDF in sr"),
    "a truncated file": (raw(constant), half, "is read without an error"),
    "a foreign file": (raw(constant, recognises=lambda head, size: True), half, "recognises a web page"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_format_is_found(case, monkeypatch):
    form, brdf, message = BROKEN[case]
    monkeypatch.setattr(formats, "FORMATS", (form,))
    with pytest.raises(AssertionError, match=message):
        suite.check_format(form, b"raw!" + bytes(CELLS), brdf)


def test_a_measurement_of_the_other_kind_is_refused_with_what_takes_it(tmp_path, tensor_bytes):
    (tmp_path / "cloth.binary").write_bytes(utia_file())
    with pytest.raises(FittersError, match=r"cloth.binary is anisotropic \(UTIA format\).*anisotropic. takes it"):
        load_material(tmp_path / "cloth.binary")
    (tmp_path / "paint.bin").write_bytes(rgl_file(tensor_bytes))
    with pytest.raises(FittersError, match=r"paint.bin is isotropic \(RGL format\): name a .bin file \(UTIA\)"):
        load_anisotropic(tmp_path / "paint.bin")
