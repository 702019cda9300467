"""Scenes: a light, a sphere and a camera, and the light table they yield."""

from fitters.scenes.environment import EnvironmentMap
from fitters.scenes.lights import load_light
from fitters.scenes.scene import Scene
from fitters.scenes.table import LightTable, light_table

__all__ = ["EnvironmentMap", "LightTable", "Scene", "light_table", "load_light"]
