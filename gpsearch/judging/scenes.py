"""What a user names as a scene: a light, or a configuration whose `scene` section is meant."""

from dataclasses import dataclass, replace
from pathlib import Path

from fitters.rendering import ImageMap, image_map
from fitters.scenes import LightTable, Scene, light_table
from fitters.scenes.lights import BUILT_IN
from gpsearch.configuration import Configuration, load_configuration

IMAGE_RESOLUTION = 96
"""Pixels across the pictures that models are judged in, unless the scene has more."""

YAML = (".yaml", ".yml")


@dataclass(frozen=True)
class NamedScene:
    """A scene as a user calls it; a relative light counts from `base`."""

    name: str
    scene: Scene
    base: Path

    @property
    def anywhere(self) -> Scene:
        """The scene, its light found from any folder."""
        light = self.scene.light
        return self.scene if light in BUILT_IN else replace(self.scene, light=str(self.base.absolute() / light))

    def image(self) -> ImageMap:
        """The image map, `IMAGE_RESOLUTION` pixels across or more. Raises `FittersError` for a bad light."""
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
    return NamedScene(Path(recipe.light).stem, recipe, configuration.folder)
