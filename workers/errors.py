"""The one root exception of this package."""

from fitters.errors import FittersError


class WorkersError(RuntimeError):
    """The work could not be run: no scheduler, no workers, a lost task. The message says what to do."""


def task_failed(label: str, index: int, error: BaseException, where: str) -> WorkersError:
    """What to raise from `error`, which task `index` of the work `label` raised on `where`.

    Bad input explains itself, and the place matters because a file may be readable here and not there;
    anything else is a defect, named by its task, type and text.
    """
    if isinstance(error, FittersError):
        return WorkersError(f"{error} (on {where})")
    return WorkersError(f"{label}: task {index} failed on {where}: {type(error).__name__}: {error}")
