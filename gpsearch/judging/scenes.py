"""What a user names as a scene: a light, or a configuration whose `scene` section is meant."""

from dataclasses import dataclass, replace
from pathlib import Path

from fitters.rendering import ImageMap, image_map
from fitters.scenes import LightTable, Scene, light_table
from fitters.scenes.lights import BUILT_IN
from fitters.scenes.scene import SPHERE
from gpsearch.configuration import Configuration, load_configuration
from gpsearch.configuration.files import resolve_path

IMAGE_RESOLUTION = 96
"""Pixels across the pictures that models are judged in, unless the scene has more."""

YAML = (".yaml", ".yml")


@dataclass(frozen=True)
class NamedScene:
    """A scene as a user calls it; relative paths of its light and geometry count from `base`."""

    name: str
    scene: Scene
    base: Path

    @property
    def anywhere(self) -> Scene:
        """The scene, its files found from any folder."""
        light, geometry = self.scene.light, self.scene.geometry
        return replace(
            self.scene,
            light=light if light in BUILT_IN else self._whole(light),
            geometry=geometry if geometry == SPHERE else self._whole(geometry),
        )

    def _whole(self, reference: str) -> str:
        return str(resolve_path(reference, self.base.absolute()))

    def image(self) -> ImageMap:
        """The image map, `IMAGE_RESOLUTION` pixels across or more. Raises `FittersError` for a bad file."""
        finer = max(self.scene.resolution, IMAGE_RESOLUTION)
        return image_map(replace(self.scene, resolution=finer), base=self.base)

    def light(self) -> LightTable:
        """The light table, of the scene as it is."""
        return light_table(self.scene, base=self.base)


def named_scene(text: str) -> NamedScene:
    """The scene of `studio`, `overcast`, a .hdr or .exr map, or of a configuration's `scene` section (.yaml).

    Raises `GpsearchError` for a file that is no configuration.
    """
    if Path(text).suffix.lower() in YAML:
        return scene_of(load_configuration(Path(text)))
    return NamedScene(Path(text).stem, Scene(light=text), Path.cwd())


def scene_of(configuration: Configuration) -> NamedScene:
    """The scene of a run."""
    recipe = configuration.scene.recipe
    files = [recipe.light] if recipe.geometry == SPHERE else [recipe.light, recipe.geometry]
    return NamedScene(" on ".join(Path(file).stem for file in files), recipe, configuration.folder)
