"""The one root exception of this package."""


class WorkersError(RuntimeError):
    """The work could not be run: no scheduler, no workers, a lost task. The message says what to do."""
