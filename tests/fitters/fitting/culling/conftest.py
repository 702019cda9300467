"""The small problems of the fits' tests."""

from tests.fitters.fitting.conftest import light, make_material

__all__ = ["light", "make_material"]
