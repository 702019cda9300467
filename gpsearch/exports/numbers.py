"""Numbers as JSON has them: it knows no infinity."""

import math


def finite(numbers: dict[str, float]) -> dict[str, float | None]:
    """Numbers by name, null for what is not finite."""
    return {name: finite_or_none(value) for name, value in numbers.items()}


def finite_or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None
