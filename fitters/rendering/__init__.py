"""Rendering: pictures of a scene with a model, without noise."""

from fitters.rendering.maps import ImageMap, image_map
from fitters.rendering.picture import Picture

__all__ = ["ImageMap", "Picture", "image_map"]
