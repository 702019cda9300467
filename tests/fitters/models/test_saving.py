"""Models in files: equal when read again; whatever else a file holds is an error that says what to do."""

import numpy as np
import pytest

from fitters.errors import FittersError
from fitters.models import KINDS, load
from tests.fitters.models.conftest import FITS, GLOSSY, save
from tests.fitters.models.sphere import random_directions


def test_a_saved_model_is_the_same_model(model, tmp_path):
    save(model, tmp_path / "model.npz")
    loaded = load(tmp_path / "model.npz").model
    w_i, w_o = random_directions(500, 1), random_directions(500, 2)
    u = np.random.default_rng(1).random((500, 3))
    assert type(loaded) is type(model)
    assert (loaded.floats, loaded.reciprocal, loaded.fit_seconds) == (
        model.floats,
        model.reciprocal,
        model.fit_seconds,
    )
    np.testing.assert_array_equal(loaded.evaluate(w_i, w_o), model.evaluate(w_i, w_o))
    np.testing.assert_array_equal(loaded.sample(w_o, u), model.sample(w_o, u))
    np.testing.assert_array_equal(loaded.pdf(w_i, w_o), model.pdf(w_i, w_o))


def test_every_kind_is_tested(fitted):
    assert {type(fitted(name, GLOSSY)) for name in FITS} == set(KINDS.values())


@pytest.fixture
def saved(fitted, tmp_path):
    path = tmp_path / "model.npz"
    save(fitted("npf-naive", GLOSSY), path)
    return path


def refusal(path):
    with pytest.raises(FittersError) as caught:
        load(path)
    return str(caught.value)


def test_a_file_cut_short_anywhere_is_refused(saved):
    content = saved.read_bytes()
    for length in (0, 10, len(content) // 2, len(content) - 1):
        saved.write_bytes(content[:length])
        assert "fit and save it again" in refusal(saved)


def test_a_garbled_file_is_refused(saved):
    """A flipped byte of the data fails the archive's checksum."""
    content = bytearray(saved.read_bytes())
    content[len(content) // 3] ^= 0xFF
    saved.write_bytes(content)
    assert "fit and save it again" in refusal(saved)


@pytest.mark.parametrize("content", [b"a text", b"PK\x03\x04 no archive", b"\x80\x04N."])
def test_a_foreign_file_is_refused(tmp_path, content):
    (tmp_path / "foreign.npz").write_bytes(content)
    assert "foreign.npz holds no model" in refusal(tmp_path / "foreign.npz")


def test_a_missing_file_and_a_folder_are_named(tmp_path):
    assert "missing.npz does not exist: check the path" in refusal(tmp_path / "missing.npz")
    assert "cannot be read" in refusal(tmp_path)


def altered(path, **changes):
    with np.load(path) as stored:
        content = {name: stored[name] for name in stored.files} | changes
    np.savez(path, **{name: value for name, value in content.items() if value is not None})
    return path


def test_an_unknown_kind_is_named_beside_the_known_ones(saved):
    message = refusal(altered(saved, kind=np.array("neural")))
    assert "'neural'" in message
    assert all(kind in message for kind in KINDS)


class Bomb:
    def __reduce__(self):
        return (pytest.fail, ("a pickle was run",))


def test_pickled_objects_are_refused_unread(saved):
    assert "holds no model" in refusal(altered(saved, rho_d=np.array([Bomb(), 1, 2], object)))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"fit_seconds": None}, "holds no model"),
        ({"kind": None}, "holds no model"),
        ({"H": None}, "npf-naive holds rho_d, rho_s, D, F, H"),
        ({"H": np.ones((90, 3))}, "H is (180, 3)"),
        ({"rho_d": np.array([0.1, np.nan, 0.1])}, "rho_d is (3,), finite and not negative"),
        ({"rho_d": np.array(["a", "b", "c"])}, "fit and save it again"),
    ],
)
def test_arrays_that_make_no_model_are_refused(saved, changes, words):
    assert words in refusal(altered(saved, **changes))


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("measured-table", {"table": np.full((3, 90, 90, 180), -1, np.float32)}),
        ("measured-table", {"table": np.ones(3, np.float32)}),
        ("ggx", {"parameters": np.ones((3, 2))}),
        ("ggx", {"expression": np.array("p0 + import")}),
        ("power-iterations", {"P": np.ones(80)}),
        ("power-iterations", {"F": np.ones((90, 2))}),
        ("power-iterations-anisotropic", {"G1": np.ones((4, 90))}),
        ("power-iterations-anisotropic", {"P": np.full((90, 90), np.nan)}),
    ],
)
def test_tables_that_do_not_fit_each_other_are_refused(fitted, tmp_path, name, changes):
    path = tmp_path / "model.npz"
    save(fitted(name, GLOSSY), path)
    assert "fit and save it again" in refusal(altered(path, **changes))


def test_a_file_that_cannot_be_written_is_named(fitted, tmp_path):
    with pytest.raises(FittersError, match=r"missing/model\.npz cannot be written: No such file"):
        save(fitted("npf-naive", GLOSSY), tmp_path / "missing" / "model.npz")
