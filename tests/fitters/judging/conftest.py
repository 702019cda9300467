"""The light and the materials of the tests of fits."""

from tests.fitters.fitting.conftest import light, make_material, shiny

__all__ = ["light", "make_material", "shiny"]
