"""The store of a run: one SQLite file with all that the run needs to go on.

One process writes (`gpsearch.run.writing`: WAL, a transaction per generation of an island), any number may read.
It holds the state of
every island after its last whole generation; nothing in it is pickled. Fits and confirmed candidates are only ever
added, with their island and generation, so that what an island knew at any time can be told from them.
"""

import json
import os
import sqlite3
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fitters.fitting import Description
from fitters.fitting.culling import Culled
from fitters.models import Baseline as StoredBaseline
from gpsearch import __version__
from gpsearch.errors import GpsearchError
from gpsearch.evolution.island import Island
from gpsearch.run.front import Front, Known, Member
from gpsearch.run.records import read, read_baseline, read_individual, read_member, read_stages
from gpsearch.run.transfers import Transfer

SCHEMA_VERSION = 3
FILE = "run.sqlite"


@dataclass(frozen=True)
class Quarantined:
    """A candidate that could not be computed: it raised, crashed or hung. Baselines have no island."""

    expression: str
    stage: str
    reason: str
    island: int | None = None
    generation: int | None = None


@dataclass(frozen=True)
class Generation:
    """What a generation of an island has cost and brought.

    candidates: individuals bred
    fitted:     of them, those whose canonical expression had to be fitted; the others were known
    given_up:   of these, those whose fit was stopped early
    confirmed:  fitted on all cells
    best:       smallest error of the population, on the small sample
    seconds:    of wall time, split in `stages`; islands share them
    at:         for how long the run had searched when this was stored; None where an earlier version stored it
    arrived:    (nodes, error) of what it has brought to the front, as far as the island knew that
    """

    island: int
    generation: int
    candidates: int
    fitted: int
    given_up: int
    confirmed: int
    best: float
    seconds: float
    stages: dict[str, float]
    at: float | None = None
    arrived: tuple[tuple[int, float], ...] = ()


class Store:
    """The run directory's SQLite file, for reading. Make one with `Store.open`, and close it.

    What writes is a `gpsearch.run.writing.WritableStore`, which needs the run's lock.
    """

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        self.path = path
        self._connection = connection

    @classmethod
    def open(cls, folder: Path) -> "Store":
        """The store of a run that is there, also where it may only be read.

        Raises `GpsearchError` for no run, a foreign or a newer file.
        """
        path = folder / FILE
        return Store(path, checked(path, _connect_read_only))

    def close(self) -> None:
        self._connection.close()

    # what a run is

    @property
    def configuration(self) -> str:
        """The resolved configuration, YAML."""
        return self.meta("configuration") or ""

    def meta(self, key: str) -> str | None:
        row = self._connection.execute("SELECT value FROM meta WHERE key = ?", (key,)).fetchone()
        return None if row is None else row[0]

    # islands

    def islands(self) -> tuple[Island, ...]:
        rows = self._connection.execute("SELECT number, generation, population FROM islands ORDER BY number")
        return tuple(
            Island(number, generation, tuple(map(read_individual, json.loads(population))))
            for number, generation, population in rows
        )

    def island_generations(self) -> dict[int, int]:
        """What every island has reached, by its number."""
        return dict(self._connection.execute("SELECT number, generation FROM islands ORDER BY number"))

    @property
    def migrations(self) -> int:
        """How often the islands have exchanged what they know."""
        return int(self.meta("migrations") or 0)

    # fits

    def fits(self) -> Iterator[tuple[str, Known]]:
        """Every fit with its canonical expression; of some expressions there are several."""
        query = "SELECT canonical, error, standard_error, bar, island, generation FROM fits"
        for canonical, *known in self._connection.execute(query):
            yield canonical, Known(*known)

    def parameters(self, fits: Mapping[str, Known], targets: int) -> dict[str, NDArray[np.float32]]:
        """Parameters (targets, parameters) of stored fits, by canonical expression."""
        query = "SELECT parameters FROM fits WHERE canonical = ? AND island = ? AND generation = ?"
        values = {}
        for canonical, known in fits.items():
            row = self._connection.execute(query, (canonical, known.island, known.generation)).fetchone()
            if row is not None:
                values[canonical] = np.frombuffer(row[0], np.float32).reshape(targets, -1)
        return values

    def seen(self) -> Iterator[tuple[str, int, int, int]]:
        """(canonical expression, island, generation, nodes) of whatever was new to an island, or smaller."""
        yield from self._connection.execute("SELECT canonical, island, generation, nodes FROM seen")

    # the front and its descriptions

    def confirmed(self) -> list[tuple[int, int, Member]]:
        """(island, generation, candidate) of what was confirmed; what is beaten by others is dropped in time."""
        rows = self._connection.execute("SELECT island, generation, member FROM confirmed")
        return [(island, generation, read_member(json.loads(text))) for island, generation, text in rows]

    def front(self) -> Front:
        return Front().updated(member for _, _, member in self.confirmed())

    def descriptions(self) -> dict[str, Description]:
        """What is known in full of front members, by expression."""
        rows = self._connection.execute("SELECT expression, description FROM descriptions")
        return {expression: read(json.loads(text), Description) for expression, text in rows}

    def culled(self) -> dict[str, Culled | None]:
        """What is left of described members, by expression; None of those that are still to be culled.

        Members that are not to be culled, as in runs of versions without culling, do not occur.
        """
        rows = self._connection.execute("SELECT expression, description FROM descriptions")
        stored = {expression: json.loads(text) for expression, text in rows}
        due = {expression: row["culled"] for expression, row in stored.items() if "culled" in row}
        return {expression: row and read(row, Culled) for expression, row in due.items()}

    # quarantine

    def quarantined(self) -> list[Quarantined]:
        rows = self._connection.execute(
            "SELECT expression, stage, reason, island, generation FROM quarantine ORDER BY generation, island"
        )
        return [Quarantined(*row) for row in rows]

    # baselines

    def baselines(self) -> dict[str, StoredBaseline]:
        """The baselines that are fitted, by name."""
        rows = self._connection.execute("SELECT name, baseline FROM baselines ORDER BY name")
        return {name: read_baseline(json.loads(text)) for name, text in rows}

    # transfers

    @property
    def _has_transfers(self) -> bool:
        query = "SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = 'transfers'"
        return self._connection.execute(query).fetchone() is not None

    def transfers(self) -> dict[tuple[str, str], Transfer]:
        """Fits to test materials, by model and by the material's reference.

        A model is the expression of a formula that was found, or the name of a baseline.
        """
        if not self._has_transfers:
            return {}
        rows = self._connection.execute("SELECT model, material, transfer FROM transfers")
        return {(model, material): read(json.loads(text), Transfer) for model, material, text in rows}

    # history

    def generations(self) -> list[Generation]:
        """The history by generation, then island."""
        rows = self._connection.execute("SELECT * FROM generations ORDER BY generation, island")
        return [Generation(*columns, **read_stages(stages)) for *columns, stages in rows]

    def totals(self) -> tuple[int, int, int]:
        """Generations that all islands have, candidates, and candidates fitted (the rest were known) so far."""
        row = self._connection.execute("SELECT TOTAL(candidates), TOTAL(fitted) FROM generations")
        candidates, fitted = row.fetchone()
        whole = self._connection.execute("SELECT MIN(generation) FROM islands").fetchone()[0]
        return int(whole or 0), int(candidates), int(fitted)

    @property
    def seconds(self) -> float:
        """How long the run has searched, its sessions added up."""
        return float(self.meta("seconds") or 0.0)

    def events(self) -> list[tuple[float, str, str]]:
        """(seconds since the epoch, kind, detail), oldest first."""
        return list(self._connection.execute("SELECT time, kind, detail FROM events ORDER BY rowid"))


def checked(path: Path, connect: Callable[[Path], sqlite3.Connection]) -> sqlite3.Connection:
    """A connection to the store of a run. Raises `GpsearchError` for no run, a foreign or a newer file."""
    if not path.is_file():
        raise GpsearchError(f"{path.parent}: no run here ({FILE} is missing); `gpsearch launch` makes one")
    try:
        connection = connect(path)
        schema = connection.execute("SELECT value FROM meta WHERE key = 'schema'").fetchone()
    except sqlite3.Error as error:
        raise GpsearchError(f"{path}: not a readable run ({error}); restore it or choose another --run") from None
    if schema is None or schema[0] != str(SCHEMA_VERSION):
        version = "none" if schema is None else schema[0]
        raise GpsearchError(
            f"{path}: its schema version is {version}, this gpsearch ({__version__}) reads {SCHEMA_VERSION};"
            f" {_whom_to_install(connection)}"
        )
    return connection


def _whom_to_install(connection: sqlite3.Connection) -> str:
    """What reads a store of another schema version."""
    try:
        package = connection.execute("SELECT value FROM meta WHERE key = 'package'").fetchone()
    except sqlite3.Error:
        package = None
    written = f"gpsearch {package[0]}, which wrote it" if package else "the version of gpsearch that wrote it"
    return f"install {written}, or name another directory with --run"


def _connect_read_only(path: Path) -> sqlite3.Connection:
    """A connection that cannot write.

    In a folder that may not be written it makes no files beside the store either. Without a log to read, the store
    itself is all there is, and does not change.
    """
    if os.access(path.parent, os.W_OK, effective_ids=True):
        connection = sqlite3.connect(path, timeout=10, isolation_level=None)
        connection.execute("PRAGMA query_only = ON")
        return connection
    address = f"{path.absolute().as_uri()}?mode=ro"
    connection = sqlite3.connect(address, timeout=10, isolation_level=None, uri=True)
    try:
        connection.execute("SELECT 1 FROM meta").fetchone()
    except sqlite3.OperationalError:
        connection.close()
        connection = sqlite3.connect(f"{address}&immutable=1", timeout=10, isolation_level=None, uri=True)
    return connection
