"""The root exception of this package."""


class GpsearchError(ValueError):
    """Bad input, or a run that cannot start, resume or be exported. The message says what, where, what to do."""


class StoreError(GpsearchError):
    """The store of a run could not be written: the disk is full, or was removed."""
