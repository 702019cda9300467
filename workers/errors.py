"""The one root exception of this package, and what it says of a task that failed as a whole."""

from fitters.errors import FittersError


class WorkersError(RuntimeError):
    """The work could not be run: no scheduler, no workers, a lost task. The message says what to do."""


def error_text(error: BaseException) -> str:
    """Bad input explains itself; anything else is named by its type."""
    return str(error) if isinstance(error, FittersError) else f"{type(error).__name__}: {error}"


def failure_text(label: str, index: int, text: str, where: str, *, bad_input: bool) -> str:
    """What to say of an error with that `error_text`, which task `index` of the work `label` met at `where`.

    The place matters because a file may be readable here and not there. What is not bad input is a defect, named
    by its task.
    """
    return f"{text} (on {where})" if bad_input else f"{label}: task {index} failed on {where}: {text}"
