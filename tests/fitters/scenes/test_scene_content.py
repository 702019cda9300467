"""What the hash of a scene file covers: a mesh that changes is another scene."""

from pathlib import Path

import pytest

from fitters.errors import FittersError
from fitters.scenes.scene_files import content_sha256

SCENE = """<scene version="3.0.0">
  <default name="mesh" value="teapot"/>
  <default name="mesh_folder" value="far"/>
  <path value="shared"/>
  <include filename="camera.xml"/>
  <shape type="obj"><string name="filename" value="near.obj"/></shape>
  <shape type="obj"><string name="filename" value="$mesh_folder/$mesh.obj"/></shape>
  <shape type="ply"><string name="filename" value="floor.ply"/></shape>
</scene>"""
CAMERA = '<scene version="3.0.0"><string name="filename" value="lens.txt"/></scene>'
FILES = ("scene.xml", "camera.xml", "lens.txt", "near.obj", "far/teapot.obj", "shared/floor.ply")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in FILES:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(name)
    (tmp_path / "scene.xml").write_text(SCENE)
    (tmp_path / "camera.xml").write_text(CAMERA)
    (tmp_path / "other.obj").write_text("nobody names this")
    return tmp_path


@pytest.mark.parametrize("name", FILES)
def test_every_file_that_belongs_to_a_scene_counts(folder, name):
    before = content_sha256(folder / "scene.xml")
    with (folder / name).open("a") as file:
        file.write("\n")
    assert content_sha256(folder / "scene.xml") != before


def test_other_files_and_the_folder_do_not_count(folder, tmp_path_factory):
    before = content_sha256(folder / "scene.xml")
    (folder / "other.obj").write_text("still nobody")
    assert content_sha256(folder / "scene.xml") == before
    moved = tmp_path_factory.mktemp("elsewhere") / "scene"
    folder.rename(moved)
    assert content_sha256(moved / "scene.xml") == before


def test_a_scene_that_includes_itself_ends(folder):
    (folder / "camera.xml").write_text('<scene version="3.0.0"><include filename="scene.xml"/></scene>')
    assert len(content_sha256(folder / "scene.xml")) == 32


def test_what_is_not_xml_is_refused(folder):
    (folder / "scene.xml").write_text("<scene><shape></scene>")
    with pytest.raises(FittersError, match=r"scene.xml: is not well-formed XML \(mismatched tag: line 1"):
        content_sha256(folder / "scene.xml")
