"""The store of a run: one SQLite file with all that the run needs to go on.

One process writes (WAL, a transaction per generation), any number may read. What it holds is the state after the
last whole generation; nothing in it is pickled.
"""

import json
import sqlite3
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fitters.fits import Description
from gpsearch.errors import GpsearchError
from gpsearch.evolution.island import Island
from gpsearch.front.baselines import Baseline
from gpsearch.front.front import Front
from gpsearch.front.records import (
    baseline_json,
    description_json,
    member_json,
    population_text,
    read_baseline,
    read_description,
    read_individual,
    read_member,
)

SCHEMA_VERSION = 2
FILE = "run.sqlite"

_SCHEMA = """
CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE islands (number INTEGER PRIMARY KEY, generation INTEGER NOT NULL, population TEXT NOT NULL);
CREATE TABLE fits (
    canonical TEXT PRIMARY KEY, error REAL NOT NULL, standard_error REAL NOT NULL, bar REAL NOT NULL,
    parameters BLOB NOT NULL, nodes INTEGER, generation INTEGER
) WITHOUT ROWID;
CREATE TABLE front (expression TEXT PRIMARY KEY, member TEXT NOT NULL, description TEXT) WITHOUT ROWID;
CREATE TABLE baselines (name TEXT PRIMARY KEY, baseline TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE generations (
    generation INTEGER PRIMARY KEY, candidates INTEGER NOT NULL, fitted INTEGER NOT NULL,
    given_up INTEGER NOT NULL, confirmed INTEGER NOT NULL, best REAL NOT NULL, seconds REAL NOT NULL,
    stages TEXT NOT NULL
);
CREATE TABLE events (time REAL NOT NULL, kind TEXT NOT NULL, detail TEXT NOT NULL);
"""


@dataclass(frozen=True)
class Generation:
    """What a generation has cost and brought.

    candidates: individuals bred
    fitted:     of them, those whose canonical expression had to be fitted; the others were known
    given_up:   of these, those whose fit was stopped early
    confirmed:  fitted on all cells
    best:       smallest error of the population, on the small sample
    seconds:    of wall time, split in `stages`
    """

    generation: int
    candidates: int
    fitted: int
    given_up: int
    confirmed: int
    best: float
    seconds: float
    stages: dict[str, float]


class Store:
    """The run directory's SQLite file. Make one with `Store.create` or `Store.open`, and close it."""

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        self.path = path
        self._connection = connection

    @classmethod
    def create(cls, folder: Path, configuration: str) -> "Store":
        """A new store in a folder that is made where it is missing. Raises `GpsearchError` where it cannot be."""
        path, part = folder / FILE, folder / f"{FILE}.part"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            part.unlink(missing_ok=True)
            # Made beside its name and moved there whole: a process killed right now leaves no half store.
            with closing(sqlite3.connect(part, isolation_level=None)) as connection, connection:
                connection.executescript(f"BEGIN;{_SCHEMA}")
                values = {
                    "schema": str(SCHEMA_VERSION),
                    "configuration": configuration,
                    "created": str(time.time()),
                }
                connection.executemany("INSERT INTO meta VALUES (?, ?)", values.items())
            part.rename(path)
            return cls(path, _connect(path))
        except (OSError, sqlite3.Error) as error:
            raise GpsearchError(
                f"{path}: the run cannot be stored there ({error}); choose another --run"
            ) from None

    @classmethod
    def open(cls, folder: Path) -> "Store":
        """The store of a run that is there. Raises `GpsearchError` for no run, a foreign or a newer file."""
        path = folder / FILE
        if not path.is_file():
            raise GpsearchError(f"{folder}: no run here ({FILE} is missing); `gpsearch launch` makes one")
        try:
            connection = _connect(path)
            found = connection.execute("SELECT value FROM meta WHERE key = 'schema'").fetchone()
        except sqlite3.Error as error:
            raise GpsearchError(
                f"{path}: not a readable run ({error}); restore it or choose another --run"
            ) from None
        if found is None or found[0] != str(SCHEMA_VERSION):
            version = "none" if found is None else found[0]
            raise GpsearchError(
                f"{path}: its schema version is {version}, this gpsearch reads {SCHEMA_VERSION};"
                " install the version of gpsearch that wrote it"
            )
        return cls(path, connection)

    def clear(self) -> None:
        """Forgets all but what kind of store this is."""
        with self.transaction():
            for table in ("islands", "fits", "front", "baselines", "generations", "events"):
                self._connection.execute(f"DELETE FROM {table}")
            self._connection.execute("DELETE FROM meta WHERE key = 'seconds'")

    def close(self) -> None:
        self._connection.close()

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """All or nothing of what is written inside. Raises `GpsearchError` where the disk refuses."""
        try:
            with self._connection:
                self._connection.execute("BEGIN IMMEDIATE")
                yield
        except sqlite3.Error as error:
            raise GpsearchError(
                f"{self.path}: cannot be written ({error}); the last whole generation is safe, the same command"
                " goes on from there"
            ) from None

    # what a run is

    @property
    def configuration(self) -> str:
        """The resolved configuration, YAML."""
        return self.meta("configuration") or ""

    def meta(self, key: str) -> str | None:
        found = self._connection.execute("SELECT value FROM meta WHERE key = ?", (key,)).fetchone()
        return None if found is None else found[0]

    def set_meta(self, key: str, value: str) -> None:
        self._connection.execute("INSERT OR REPLACE INTO meta VALUES (?, ?)", (key, value))

    # islands

    def islands(self) -> tuple[Island, ...]:
        rows = self._connection.execute("SELECT number, generation, population FROM islands ORDER BY number")
        return tuple(
            Island(number, generation, tuple(map(read_individual, json.loads(population))))
            for number, generation, population in rows
        )

    def save_islands(self, islands: Iterable[Island]) -> None:
        rows = [(island.number, island.generation, population_text(island.population)) for island in islands]
        self._connection.executemany("INSERT OR REPLACE INTO islands VALUES (?, ?, ?)", rows)

    # fits

    def fits(self) -> dict[str, tuple[float, float, float]]:
        """Error, its standard error and the bar of every fit, by canonical expression.

        The bar is infinite where the fit was finished.
        """
        rows = self._connection.execute("SELECT canonical, error, standard_error, bar FROM fits")
        return {canonical: tuple(known) for canonical, *known in rows}

    def seen(self) -> dict[str, int]:
        """Smallest sizes of the expressions that occurred in whole generations, by canonical expression.

        Others were fitted in a generation that was broken off.
        """
        return dict(self._connection.execute("SELECT canonical, nodes FROM fits WHERE generation >= 0"))

    def parameters(self, canonical: Sequence[str], targets: int) -> dict[str, NDArray[np.float32]]:
        """Parameters (targets, parameters) of stored fits, by canonical expression."""
        found = {}
        for expression in canonical:
            query = "SELECT parameters FROM fits WHERE canonical = ?"
            row = self._connection.execute(query, (expression,)).fetchone()
            if row is not None:
                found[expression] = np.frombuffer(row[0], np.float32).reshape(targets, -1)
        return found

    def save_fits(self, rows: Iterable[tuple[str, float, float, float, NDArray[np.float32]]]) -> None:
        """Canonical expressions, errors, their standard errors, bars and parameters."""
        self._connection.executemany(
            "INSERT INTO fits VALUES (?, ?, ?, ?, ?, NULL, NULL) ON CONFLICT (canonical) DO UPDATE"
            " SET error = excluded.error, standard_error = excluded.standard_error, bar = excluded.bar,"
            " parameters = excluded.parameters",
            [(*known, values.tobytes()) for *known, values in rows],
        )

    def save_seen(self, nodes: Mapping[str, int], generation: int) -> None:
        """Sizes by canonical expression of what occurred in a whole generation."""
        self._connection.executemany(
            "UPDATE fits SET nodes = ?, generation = coalesce(generation, ?) WHERE canonical = ?",
            [(count, generation, canonical) for canonical, count in nodes.items()],
        )

    # the front and its descriptions

    def front(self) -> Front:
        rows = self._connection.execute("SELECT member FROM front")
        return Front().updated(read_member(json.loads(row[0])) for row in rows)

    def save_front(self, front: Front) -> None:
        """Writes new members and drops those that left; descriptions of those that stay are kept."""
        kept = {member.expression for member in front.members}
        there = {row[0] for row in self._connection.execute("SELECT expression FROM front")}
        self._connection.executemany("DELETE FROM front WHERE expression = ?", [(e,) for e in there - kept])
        rows = [(m.expression, json.dumps(member_json(m))) for m in front.members if m.expression not in there]
        self._connection.executemany("INSERT INTO front VALUES (?, ?, NULL)", rows)

    def descriptions(self) -> dict[str, Description]:
        """What is known in full of front members, by expression."""
        rows = self._connection.execute("SELECT expression, description FROM front WHERE description IS NOT NULL")
        return {expression: read_description(json.loads(text)) for expression, text in rows}

    def save_description(self, expression: str, description: Description) -> None:
        text = json.dumps(description_json(description))
        self._connection.execute("UPDATE front SET description = ? WHERE expression = ?", (text, expression))

    # baselines

    def baselines(self) -> dict[str, Baseline]:
        """The baselines that are fitted, by name."""
        rows = self._connection.execute("SELECT name, baseline FROM baselines ORDER BY name")
        return {name: read_baseline(json.loads(text)) for name, text in rows}

    def save_baseline(self, name: str, baseline: Baseline) -> None:
        text = json.dumps(baseline_json(baseline))
        self._connection.execute("INSERT OR REPLACE INTO baselines VALUES (?, ?)", (name, text))

    # history

    def save_generation(self, row: Generation) -> None:
        values = (*astuple(row)[:-1], json.dumps(row.stages))
        marks = ", ".join("?" * len(values))
        self._connection.execute(f"INSERT OR REPLACE INTO generations VALUES ({marks})", values)

    def generations(self) -> list[Generation]:
        """The history, oldest first."""
        rows = self._connection.execute("SELECT * FROM generations ORDER BY generation")
        names = [field.name for field in fields(Generation)]
        found = [dict(zip(names, row, strict=True)) for row in rows]
        return [Generation(**(row | {"stages": json.loads(row["stages"])})) for row in found]

    def require_generation(self, generation: int) -> None:
        """Raises `GpsearchError` where another process has gone on from there; call it in a transaction."""
        found = self._connection.execute("SELECT MAX(generation) FROM generations").fetchone()[0] or 0
        if found != generation:
            raise GpsearchError(
                f"{self.path}: another gpsearch runs here, which is at generation {found}; leave it to one of them"
            )

    def totals(self) -> tuple[int, int, int]:
        """Generations, candidates, and candidates fitted (the rest were known) so far."""
        row = self._connection.execute("SELECT COUNT(*), TOTAL(candidates), TOTAL(fitted) FROM generations")
        generations, candidates, fitted = row.fetchone()
        return int(generations), int(candidates), int(fitted)

    @property
    def seconds(self) -> float:
        """How long the run has searched, its sessions added up."""
        return float(self.meta("seconds") or 0.0)

    def save_seconds(self, seconds: float) -> None:
        self.set_meta("seconds", str(seconds))

    def log(self, kind: str, detail: str) -> None:
        self._connection.execute("INSERT INTO events VALUES (?, ?, ?)", (time.time(), kind, detail))

    def events(self) -> list[tuple[float, str, str]]:
        """(seconds since the epoch, kind, detail), oldest first."""
        return list(self._connection.execute("SELECT time, kind, detail FROM events ORDER BY rowid"))


def _connect(path: Path) -> sqlite3.Connection:
    connection = sqlite3.connect(path, timeout=10, isolation_level=None)
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("PRAGMA synchronous = NORMAL")
    return connection
