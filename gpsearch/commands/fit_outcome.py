"""What a fit leaves for the command: one report as JSON and as text, and the model to keep."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from fitters.fitting.problem import CHANNELS
from fitters.models import Model
from fitters.scenes import Scene


@dataclass(frozen=True, eq=False)
class Request:
    """What is asked for: a model by name or text, materials by reference, a light or a whole scene, a metric."""

    model: str
    materials: tuple[str, ...]
    light: str
    metric: str
    scene: Scene | None = None

    @property
    def seen(self) -> Scene:
        """The scene that is fitted in: by default the light with all else as it is by default."""
        return self.scene or Scene(light=self.light)


@dataclass(frozen=True, eq=False)
class Outcome:
    """`report` is the JSON object, `text` the same for readers; `models` the fitted model of each material."""

    report: dict[str, Any]
    text: str
    models: tuple[Model, ...]


def named(names: Sequence[str]) -> dict[str, Any]:
    """The keys that say what was fitted: `materials`, and `material` where it is one."""
    return {"materials": list(names)} | ({"material": names[0]} if len(names) == 1 else {})


def channel_lines(errors: Sequence[float], remarks: Sequence[str]) -> list[str]:
    """A line for each channel: its error, and a remark."""
    rows = zip(CHANNELS, errors, remarks, strict=True)
    return [f"  {channel:5s}  error {error:.4f}  {remark}".rstrip() for channel, error, remark in rows]
