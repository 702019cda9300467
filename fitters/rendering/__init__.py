"""Rendering: pictures of a scene with a model, without noise, and how far one is from another."""

from fitters.rendering.image_map import ImageMap, image_map
from fitters.rendering.metrics import IMAGE_METRICS, Comparison, ImageMetric
from fitters.rendering.picture import Picture

__all__ = ["IMAGE_METRICS", "Comparison", "ImageMap", "ImageMetric", "Picture", "image_map"]
