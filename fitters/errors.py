"""The one root exception of this package."""


class FittersError(ValueError):
    """Bad input to a fit: a material, a scene, an expression. The message says what, where and what to do."""
