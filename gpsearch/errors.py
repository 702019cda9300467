"""The one root exception of this package."""


class GpsearchError(ValueError):
    """A run could not be started, resumed or exported. The message says what, where and what to do."""


class StoreError(GpsearchError):
    """A run on its way could not be written down: the disk is full, or gone."""
