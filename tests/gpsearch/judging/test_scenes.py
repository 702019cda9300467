"""What is judged: a scene by its light, or as a configuration describes it."""

import os
from pathlib import Path

import pytest

from fitters.scenes import Scene
from gpsearch.judging.scenes import named_scene


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the files of a scene lie, which is not the working folder."""
    for name in ("sky.exr", "room.xml"):
        (tmp_path / name).touch()
    monkeypatch.chdir(os.sep)
    return tmp_path


@pytest.mark.parametrize(
    ("section", "name", "expected"),
    [
        ("{light: overcast, resolution: 8}", "overcast", {"light": "overcast", "resolution": 8}),
        ("{light: sky.exr}", "sky", {"light": "{folder}/sky.exr"}),
        (
            "{geometry: room.xml, shape: lamp}",
            "studio on room",
            {"geometry": "{folder}/room.xml", "shape": "lamp"},
        ),
        (
            "{light: sky.exr, geometry: room.xml}",
            "sky on room",
            {"light": "{folder}/sky.exr", "geometry": "{folder}/room.xml"},
        ),
    ],
)
def test_the_files_of_a_configuration_are_found_from_any_folder(folder, section, name, expected):
    (folder / "run.yaml").write_text(f"materials: [builtin:metal]\nscene: {section}\n")
    found = named_scene(str(folder / "run.yaml"))
    whole = {key: v.format(folder=folder) if isinstance(v, str) else v for key, v in expected.items()}
    assert (found.name, found.anywhere) == (name, Scene(**whole))
