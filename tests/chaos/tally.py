"""What the chaos suite has done, for the summary at the end."""

from collections import Counter
from dataclasses import dataclass, field


@dataclass
class Tally:
    """Blows by what they hit, and how the runs came out."""

    blows: Counter[str] = field(default_factory=Counter)
    moments: list[str] = field(default_factory=list)
    runs: int = 0
    identical: int = 0
    generations_safe: int = 0
    generations_lost: int = 0
    retries: int = 0

    def lines(self) -> list[str]:
        blows = ", ".join(f"{count} {what}" for what, count in sorted(self.blows.items()))
        return [
            *self.moments,
            f"survived: {blows or 'nothing'}",
            f"fronts identical: {self.identical} of {self.runs}",
            f"stored generations found again after blows to launchers: {self.generations_safe},"
            f" lost: {self.generations_lost}; tasks that went out again: {self.retries}",
        ]


TALLY = Tally()
