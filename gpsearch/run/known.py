"""What is remembered of a candidate's fit on the small sample."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Known:
    """A fit on the small sample.

    error:      infinite where nothing finite was found; of a fit that was given up, what it had reached
    bar:        what the fit failed; infinite where it was carried through
    island:     that had it fitted
    generation: in which that was
    """

    error: float
    standard_error: float = 0.0
    bar: float = math.inf
    island: int = 0
    generation: int = 0

    @property
    def precedence(self) -> tuple[float, int, int]:
        """Of several fits of a form the one that sorts first counts: carried furthest, then the oldest."""
        return (-self.bar, self.generation, self.island)
