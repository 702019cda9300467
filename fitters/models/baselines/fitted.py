"""What the fit of a baseline leaves."""

from dataclasses import dataclass, field
from typing import Any

from fitters.models import Model


@dataclass(frozen=True, eq=False)
class Fitted:
    """A model fitted to a material; `details` is what only this kind of model has to report, as plain objects."""

    model: Model
    details: dict[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
