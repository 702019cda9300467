"""Images of models in a scene, without noise, and how far one is from another."""

from fitters.rendering.image_map import ImageMap, image_map
from fitters.rendering.picture import Picture

__all__ = ["ImageMap", "Picture", "image_map"]
