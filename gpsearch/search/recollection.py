"""What islands knew when a run was left, from its store."""

from collections.abc import Iterable
from typing import Any

from gpsearch.run import Store
from gpsearch.search.course import Course
from gpsearch.search.memory import Shared


class Recollection:
    """What a store holds up to the last migration, which was in `generation`, and since."""

    def __init__(self, store: Store, generation: int) -> None:
        self._generation = generation
        fits = ((known.island, known.generation, (key, known)) for key, known in store.fits())
        sizes = ((island, generation, (key, nodes)) for key, island, generation, nodes in store.seen())
        self._fits, self._sizes, self._confirmed = map(self._divided, (fits, sizes, store.confirmed()))

    def _divided(self, rows: Iterable[tuple[int, int, Any]]) -> "_Divided":
        """Rows of (island, generation, what)."""
        found = _Divided()
        for island, generation, what in rows:
            if generation <= self._generation:
                found.before.append(what)
            else:
                found.since.setdefault(island, []).append((generation, what))
        return found

    def shared(self) -> Shared:
        """What all islands knew at the last migration."""
        shared = Shared()
        shared.learn(self._fits.before)
        shared.see(self._sizes.before)
        shared.front = shared.front.updated(self._confirmed.before)
        return shared

    def remind(self, course: Course) -> None:
        """Gives an island what it has found since, as far as its generations were whole, and the fits beyond."""
        memory, island = course.memory, course.island
        for generation, (key, known) in self._fits.of(island.number):
            (memory.own if generation <= island.generation else memory.fresh)[key] = known
        for _, (key, nodes) in self._sizes.of(island.number):
            memory.sizes[key] = nodes
        memory.front = memory.front.updated(member for _, member in self._confirmed.of(island.number))


class _Divided:
    """What is from before the last migration, and by island what is from after it, with its generation."""

    def __init__(self) -> None:
        self.before: list[Any] = []
        self.since: dict[int, list[tuple[int, Any]]] = {}

    def of(self, island: int) -> list[tuple[int, Any]]:
        """By rising generation."""
        return sorted(self.since.get(island, []), key=lambda row: row[0])
