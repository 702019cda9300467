"""What the front of a run was at every time of its search."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fitters.fitting import RESIDUALS
from gpsearch.configuration import Configuration
from gpsearch.errors import GpsearchError
from gpsearch.run import Generation, Store, non_dominated
from gpsearch.run.identity import ProblemIdentity

UNTOLD = ("seed", "budget.", "executor", "name")
"""Keys in which runs of one name may differ and still be repetitions of one search."""


@dataclass(frozen=True)
class FrontStep:
    """The front from `seconds` of search on: its best error and that formula's size, hypervolume and members."""

    seconds: float
    error: float
    nodes: int
    hypervolume: float
    members: int


@dataclass(frozen=True)
class Curve:
    """A run's steps, by rising seconds, the errors never rising; `seconds` is for how long it has searched."""

    run: Path
    name: str
    seed: int
    seconds: float
    candidates: int
    steps: tuple[FrontStep, ...]

    def at(self, seconds: float) -> FrontStep | None:
        """What holds at a time; None before there is a front."""
        return next((step for step in reversed(self.steps) if step.seconds <= seconds), None)

    def first_below(self, error: float) -> float | None:
        """When the best error was first this or less; None where it never was."""
        return next((step.seconds for step in self.steps if step.error <= error), None)


@dataclass(frozen=True)
class Reference:
    """The corner from which a hypervolume counts."""

    nodes: int
    error: float


Point = tuple[int, float]
"""Nodes and error of a member."""


@dataclass(frozen=True)
class SearchedRun:
    """A run directory, what it was configured to do, and its history as the store has it."""

    folder: Path
    configuration: Configuration
    identity: ProblemIdentity | None
    generations: tuple[Generation, ...]
    seconds: float

    @classmethod
    def of(cls, folder: Path, store: Store, configuration: Configuration) -> "SearchedRun":
        """Raises `GpsearchError` where nothing is known of the front's history."""
        # The front first: a run that is searching can only add to the history of what was read.
        front = {(member.nodes, member.error) for member in store.front().members}
        generations = tuple(store.generations())
        if not front:
            raise GpsearchError(f"{folder}: the run has no front yet; `gpsearch launch` goes on with it")
        if not front <= {point for generation in generations for point in generation.arrived}:
            raise GpsearchError(
                f"{folder}: the run was begun by a version of gpsearch that did not note when the front was found;"
                " launch its configuration again with another --run"
            )
        return cls(folder, configuration, ProblemIdentity.of(store, configuration), generations, store.seconds)

    @property
    def arrivals(self) -> list[tuple[float, tuple[Point, ...]]]:
        """(seconds, members that came to the front), in order of time."""
        arrivals = [(g.at, g.arrived) for g in self.generations if g.arrived and g.at is not None]
        return sorted(arrivals, key=lambda arrival: arrival[0])

    def curve(self, name: str, reference: Reference) -> Curve:
        front: list[Point] = []
        steps = []
        for seconds, arrived in self.arrivals:
            after = non_dominated([*front, *arrived], costs=lambda point: point)
            if after != front:
                front = after
                nodes, error = front[-1]
                steps.append(FrontStep(seconds, error, nodes, hypervolume(front, reference), len(front)))
        candidates = sum(generation.candidates for generation in self.generations)
        return Curve(self.folder, name, self.configuration.seed, self.seconds, candidates, tuple(steps))


def curves(runs: Sequence[SearchedRun]) -> list[Curve]:
    """The curves of runs, in their order, with one reference for all.

    A run is named after its configuration; of runs of one name that differ in more than the seed and the budget
    each has its folder's name, too. Raises `GpsearchError` for runs whose errors cannot be compared.
    """
    first = runs[0]
    for other in runs[1:]:
        _require_same_problem(first, other)
    reference = _reference(runs)
    return [run.curve(_name(run, runs), reference) for run in runs]


def hypervolume(front: Sequence[Point], reference: Reference) -> float:
    """The share of the rectangle from no nodes and no error to the reference that a front beats, 0 to 1.

    `front` by rising size and falling error (Zitzler and Thiele 1999, in two dimensions).
    """
    inside = [(nodes, error) for nodes, error in front if nodes < reference.nodes and error < reference.error]
    ends = [*(nodes for nodes, _ in inside), reference.nodes][1:]
    area = sum((end - nodes) * (reference.error - error) for (nodes, error), end in zip(inside, ends, strict=True))
    return area / (reference.nodes * reference.error)


def _reference(runs: Sequence[SearchedRun]) -> Reference:
    """The largest formula that a run allows; the error of a black one, or the worst there is for a plain sum."""
    worst = max(error for run in runs for _, arrived in run.arrivals for _, error in arrived)
    normalised = RESIDUALS[runs[0].configuration.metric].normalised
    return Reference(max(run.configuration.search.max_nodes for run in runs), 1.0 if normalised else worst)


def _name(run: SearchedRun, runs: Sequence[SearchedRun]) -> str:
    name = run.configuration.name
    alike = [other for other in runs if other.configuration.name == name]
    differ = any(
        not difference.key.startswith(UNTOLD)
        for other in alike
        for difference in run.configuration.differences(other.configuration)
    )
    return f"{name} ({run.folder.name})" if differ else name


def _require_same_problem(first: SearchedRun, other: SearchedRun) -> None:
    """Errors count over the lit cells of materials: other ones have other errors.

    Runs that have not stored their content hashes are compared by their configurations.
    """
    if first.identity and other.identity:
        changed = first.identity.differences(other.identity)
    else:
        here, there = (_problem(run.configuration) for run in (first, other))
        changed = [f"{key}: {there[key]} instead of {value}" for key, value in here.items() if there[key] != value]
    if changed:
        raise GpsearchError(
            f"{other.folder}: its errors cannot be compared with those of {first.folder}"
            f" ({'; '.join(changed)}); chart runs of one problem"
        )


def _problem(configuration: Configuration) -> dict[str, object]:
    scene = configuration.scene
    return {
        "materials": ", ".join(configuration.material_names),
        "metric": configuration.metric,
        "scene.light": Path(scene.light).name,
        "scene.rotation": scene.rotation,
        "scene.resolution": scene.resolution,
        "scene.light_rows": scene.light_rows,
        "scene.geometry": Path(scene.geometry).name,
        "scene.shape": scene.shape,
        "scene.shadows": scene.shadows,
    }
