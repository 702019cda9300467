"""The store of a run: one SQLite file with all that the run needs to go on.

One process writes (WAL, a transaction per generation), any number may read. What it holds is the state after the
last whole generation; nothing in it is pickled.
"""

import json
import sqlite3
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from fitters.fits import Description, Fit
from fitters.fits.checks import Checks
from gpsearch.errors import GpsearchError
from gpsearch.evolution.island import Individual, Island
from gpsearch.front.front import Front, Member
from gpsearch.genomes import Genome

SCHEMA_VERSION = 1
FILE = "run.sqlite"

_SCHEMA = """
CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE islands (number INTEGER PRIMARY KEY, generation INTEGER NOT NULL, population TEXT NOT NULL);
CREATE TABLE fits (expression TEXT PRIMARY KEY, error REAL NOT NULL, generation INTEGER) WITHOUT ROWID;
CREATE TABLE front (expression TEXT PRIMARY KEY, member TEXT NOT NULL, description TEXT) WITHOUT ROWID;
CREATE TABLE baselines (name TEXT PRIMARY KEY, baseline TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE generations (
    generation INTEGER PRIMARY KEY, candidates INTEGER NOT NULL, fitted INTEGER NOT NULL,
    best REAL NOT NULL, seconds REAL NOT NULL
);
CREATE TABLE events (time REAL NOT NULL, kind TEXT NOT NULL, detail TEXT NOT NULL);
"""


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
            Island(number, generation, tuple(map(_individual, json.loads(population))))
            for number, generation, population in rows
        )

    def save_islands(self, islands: Iterable[Island]) -> None:
        rows = [
            (island.number, island.generation, json.dumps(list(map(_individual_json, island.population))))
            for island in islands
        ]
        self._connection.executemany("INSERT OR REPLACE INTO islands VALUES (?, ?, ?)", rows)

    # fits

    def errors(self) -> dict[str, float]:
        """The error of every expression that was ever screened."""
        return dict(self._connection.execute("SELECT expression, error FROM fits"))

    def seen(self) -> set[str]:
        """The expressions that occurred in whole generations; others were screened in one that was broken off."""
        return {row[0] for row in self._connection.execute("SELECT expression FROM fits WHERE generation >= 0")}

    def save_errors(self, errors: Mapping[str, float], generation: int | None) -> None:
        """Errors by expression, with the whole generation in which they first occurred, if there is one."""
        rows = [(expression, error, generation) for expression, error in errors.items()]
        self._connection.executemany(
            "INSERT INTO fits VALUES (?, ?, ?)"
            " ON CONFLICT (expression) DO UPDATE SET generation = coalesce(generation, excluded.generation)",
            rows,
        )

    # the front and its descriptions

    def front(self) -> Front:
        rows = self._connection.execute("SELECT member FROM front")
        return Front().updated(_member(json.loads(row[0])) for row in rows)

    def save_front(self, front: Front) -> None:
        """Writes new members and drops those that left; descriptions of those that stay are kept."""
        kept = {member.expression for member in front.members}
        there = {row[0] for row in self._connection.execute("SELECT expression FROM front")}
        self._connection.executemany("DELETE FROM front WHERE expression = ?", [(e,) for e in there - kept])
        rows = [(m.expression, json.dumps(_member_json(m))) for m in front.members if m.expression not in there]
        self._connection.executemany("INSERT INTO front VALUES (?, ?, NULL)", rows)

    def descriptions(self) -> dict[str, Description]:
        """What is known in full of front members, by expression."""
        rows = self._connection.execute("SELECT expression, description FROM front WHERE description IS NOT NULL")
        return {expression: _description(json.loads(text)) for expression, text in rows}

    def save_description(self, expression: str, description: Description) -> None:
        text = json.dumps(_description_json(description))
        self._connection.execute("UPDATE front SET description = ? WHERE expression = ?", (text, expression))

    # baselines

    def baselines(self) -> dict[str, tuple[Description, float]]:
        """Description and fit seconds by name."""
        rows = self._connection.execute("SELECT name, baseline FROM baselines ORDER BY name")
        loaded = {name: json.loads(text) for name, text in rows}
        return {name: (_description(b["description"]), b["fit_seconds"]) for name, b in loaded.items()}

    def save_baseline(self, name: str, description: Description, fit_seconds: float) -> None:
        text = json.dumps({"description": _description_json(description), "fit_seconds": fit_seconds})
        self._connection.execute("INSERT OR REPLACE INTO baselines VALUES (?, ?)", (name, text))

    # history

    def save_generation(self, generation: int, candidates: int, fitted: int, best: float, seconds: float) -> None:
        row = (generation, candidates, fitted, best, seconds)
        self._connection.execute("INSERT OR REPLACE INTO generations VALUES (?, ?, ?, ?, ?)", row)

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
        """How long the run has gone on, its sessions added up."""
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


# JSON forms. Python writes floats so that they read back to the last bit, and infinity as Infinity.


def _individual_json(individual: Individual) -> list[Any]:
    genome = individual.genome
    return [genome.start, genome.to_json(), individual.expression, individual.nodes, individual.error]


def _individual(stored: list[Any]) -> Individual:
    start, edits, expression, nodes, error = stored
    return Individual(Genome.from_json(start, edits), expression, nodes, error)


def _fit_json(fit: Fit) -> dict[str, Any]:
    return {
        "names": fit.names,
        "values": fit.values.tolist(),
        "errors": fit.errors.tolist(),
        "error": fit.error,
        "evaluations": fit.evaluations,
    }


def _fit(stored: dict[str, Any]) -> Fit:
    names = tuple(stored["names"])
    values = np.array(stored["values"], np.float64).reshape(len(stored["errors"]), len(names))
    return Fit(names, values, np.array(stored["errors"], np.float64), stored["error"], stored["evaluations"])


def _member_json(member: Member) -> dict[str, Any]:
    return {
        "expression": member.expression,
        "nodes": member.nodes,
        "start": member.genome.start,
        "edits": member.genome.to_json(),
        "island": member.island,
        "generation": member.generation,
        "fit": _fit_json(member.fit),
        "screened": member.screened,
    }


def _member(stored: dict[str, Any]) -> Member:
    return Member(
        expression=stored["expression"],
        nodes=stored["nodes"],
        genome=Genome.from_json(stored["start"], stored["edits"]),
        island=stored["island"],
        generation=stored["generation"],
        fit=_fit(stored["fit"]),
        screened=stored["screened"],
    )


def _description_json(description: Description) -> dict[str, Any]:
    return {
        "fit": _fit_json(description.fit),
        "metrics": description.metrics,
        "checks": vars(description.checks),
        "cost_ns": description.cost_ns,
    }


def _description(stored: dict[str, Any]) -> Description:
    return Description(_fit(stored["fit"]), stored["metrics"], Checks(**stored["checks"]), stored["cost_ns"])
