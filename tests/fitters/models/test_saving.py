"""Models in files: equal when read again; whatever else a file holds is an error that says what to do."""

import numpy as np
import pytest

from fitters.errors import FittersError
from fitters.models import KINDS, Fitted, MaterialFit, load
from fitters.testing.sphere import random_directions
from tests.fitters.models.conftest import GLOSSY, ROUGH, save


def test_a_file_of_one_model_and_no_report_is_read(fitted, tmp_path):
    """As gpsearch 0.1 wrote it."""
    model = fitted("npf-naive", GLOSSY)
    arrays = {"kind": np.array(model.kind), "fit_seconds": np.array(1.5), **model.arrays()}
    np.savez_compressed(tmp_path / "steel.npz", **arrays)
    loaded = load(tmp_path / "steel.npz")
    assert (loaded.name, loaded.materials, loaded.fit_seconds) == ("npf-naive", ("steel",), 1.5)
    w_i, w_o = random_directions(500, 1), random_directions(500, 2)
    np.testing.assert_array_equal(loaded.evaluate(w_i, w_o), model.evaluate(w_i, w_o))
    with pytest.raises(FittersError, match="does not say its error"):
        _ = loaded.error


def test_several_materials_are_in_one_file(fitted, tmp_path):
    models = {"a": fitted("ggx", GLOSSY), "b": fitted("ggx", ROUGH)}
    fits = {name: MaterialFit(model) for name, model in models.items()}
    errors = dict.fromkeys(models, (0.1, 0.2, 0.3))
    Fitted("ggx", fits, "light", errors, {"light": 0.2}, 1.0, ("a: odd",)).save(tmp_path / "both.npz")
    loaded = load(tmp_path / "both.npz")
    assert (loaded.materials, loaded.errors, loaded.warnings) == (("a", "b"), errors, ("a: odd",))
    for name, model in models.items():
        np.testing.assert_array_equal(loaded[name].parameters, model.parameters)
    with pytest.raises(FittersError, match=r'choose one, fitted\["a"\]'):
        _ = loaded.model
    with pytest.raises(FittersError, match="not fitted to 'c': there is a, b"):
        _ = loaded["c"]


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
        ("measured", {"table": np.full((3, 90, 90, 180), -1, np.float32)}),
        ("measured", {"table": np.ones(3, np.float32)}),
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
