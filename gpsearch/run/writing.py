"""The store of a run as its launcher has it: for writing, which needs the run's lock."""

import json
import sqlite3
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import astuple
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fitters.fitting import Description
from fitters.fitting.culling import Culled
from fitters.models import Baseline as StoredBaseline
from gpsearch import __version__
from gpsearch.errors import GpsearchError, StoreError
from gpsearch.evolution.island import Island
from gpsearch.run.front import Front, Known, Member
from gpsearch.run.lock import RunLock
from gpsearch.run.records import plain, population_text, text_of
from gpsearch.run.store import FILE, SCHEMA_VERSION, Generation, Quarantined, Store, checked
from gpsearch.run.transfers import Transfer

_SCHEMA = """
CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE islands (number INTEGER PRIMARY KEY, generation INTEGER NOT NULL, population TEXT NOT NULL);
CREATE TABLE fits (
    canonical TEXT NOT NULL, island INTEGER NOT NULL, generation INTEGER NOT NULL, error REAL NOT NULL,
    standard_error REAL NOT NULL, bar REAL NOT NULL, parameters BLOB NOT NULL,
    PRIMARY KEY (canonical, island, generation)
) WITHOUT ROWID;
CREATE TABLE seen (
    canonical TEXT NOT NULL, island INTEGER NOT NULL, generation INTEGER NOT NULL, nodes INTEGER NOT NULL,
    PRIMARY KEY (canonical, island, generation)
) WITHOUT ROWID;
CREATE TABLE confirmed (
    expression TEXT NOT NULL, island INTEGER NOT NULL, generation INTEGER NOT NULL, member TEXT NOT NULL,
    PRIMARY KEY (expression, island, generation)
) WITHOUT ROWID;
CREATE TABLE descriptions (expression TEXT PRIMARY KEY, description TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE quarantine (
    expression TEXT NOT NULL, stage TEXT NOT NULL, reason TEXT NOT NULL, island INTEGER, generation INTEGER,
    PRIMARY KEY (expression, stage)
) WITHOUT ROWID;
CREATE TABLE baselines (name TEXT PRIMARY KEY, baseline TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE generations (
    island INTEGER NOT NULL, generation INTEGER NOT NULL, candidates INTEGER NOT NULL, fitted INTEGER NOT NULL,
    given_up INTEGER NOT NULL, confirmed INTEGER NOT NULL, best REAL NOT NULL, seconds REAL NOT NULL,
    stages TEXT NOT NULL, PRIMARY KEY (island, generation)
) WITHOUT ROWID;
CREATE TABLE events (time REAL NOT NULL, kind TEXT NOT NULL, detail TEXT NOT NULL);
"""

_TRANSFERS = """
CREATE TABLE IF NOT EXISTS transfers (
    model TEXT NOT NULL, material TEXT NOT NULL, transfer TEXT NOT NULL, PRIMARY KEY (model, material)
) WITHOUT ROWID;
"""
"""Made where a first transfer is stored: stores without one, of earlier versions too, do without it."""

TABLES = (
    "islands",
    "fits",
    "seen",
    "confirmed",
    "descriptions",
    "quarantine",
    "baselines",
    "generations",
    "events",
)


class WritableStore(Store):
    """A store that can be written while its lock is held. Make one with `create` or `of`, and close it."""

    def __init__(self, path: Path, connection: sqlite3.Connection, lock: RunLock) -> None:
        super().__init__(path, connection)
        self._lock = lock

    @classmethod
    def create(cls, lock: RunLock, configuration: str) -> "WritableStore":
        """A new store in the folder of a lock. Raises `GpsearchError` where it cannot be made."""
        path, part = lock.folder / FILE, lock.folder / f"{FILE}.part"
        try:
            part.unlink(missing_ok=True)
            # Made beside its name and moved there whole: a process killed right now leaves no half store.
            with closing(sqlite3.connect(part, isolation_level=None)) as connection, connection:
                connection.executescript(f"BEGIN;{_SCHEMA}")
                values = {
                    "schema": str(SCHEMA_VERSION),
                    "configuration": configuration,
                    "created": str(time.time()),
                    "package": __version__,
                }
                connection.executemany("INSERT INTO meta VALUES (?, ?)", values.items())
            # The log of a store that was taken away would be replayed into this one.
            for left in ("-wal", "-shm"):
                path.with_name(path.name + left).unlink(missing_ok=True)
            part.rename(path)
            return cls(path, _connect(path), lock)
        except (OSError, sqlite3.Error) as error:
            raise GpsearchError(
                f"{path}: the run cannot be stored there ({error}); choose another --run"
            ) from None

    @classmethod
    def of(cls, lock: RunLock) -> "WritableStore":
        """The store that is in the folder of a lock. Raises `GpsearchError` as `Store.open` does."""
        path = lock.folder / FILE
        return cls(path, checked(path, _connect), lock)

    def clear(self) -> None:
        """Forgets all but what kind of store this is."""
        with self.transaction():
            for table in (*TABLES, *(("transfers",) if self._has_transfers else ())):
                self._connection.execute(f"DELETE FROM {table}")
            self._connection.execute("DELETE FROM meta WHERE key IN ('seconds', 'migrations')")

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """All or nothing of what is written inside.

        Raises `StoreError` where the disk refuses, `GpsearchError` where the lock was released.
        """
        if not self._lock.held:
            raise GpsearchError(f"{self.path}: the lock of the run was released; lock it again to write")
        try:
            if self._connection.in_transaction:
                # A signal came between the end of the last one and its commitment.
                self._connection.rollback()
            with self._connection:
                self._connection.execute("BEGIN IMMEDIATE")
                yield
        except sqlite3.IntegrityError as error:
            # Fits and generations are only ever added: what is there already was found by another process.
            raise GpsearchError(
                f"{self.path}: another gpsearch has gone on with this run ({error}): leave it to one of them, and"
                " to one version"
            ) from None
        except sqlite3.Error as error:
            raise StoreError(
                f"{self.path}: cannot be written ({error}); the last whole generations are safe: make room or mend"
                " the disk, and the same command goes on from there"
            ) from None

    def set_meta(self, key: str, value: str) -> None:
        self._connection.execute("INSERT OR REPLACE INTO meta VALUES (?, ?)", (key, value))

    def save_islands(self, islands: Iterable[Island]) -> None:
        rows = [(island.number, island.generation, population_text(island.population)) for island in islands]
        self._connection.executemany("INSERT OR REPLACE INTO islands VALUES (?, ?, ?)", rows)

    def save_migrations(self, count: int) -> None:
        self.set_meta("migrations", str(count))

    def save_fits(self, rows: Iterable[tuple[str, Known, NDArray[np.float32]]]) -> None:
        """Canonical expressions, fits and their parameters."""
        self._connection.executemany(
            "INSERT INTO fits VALUES (?, ?, ?, ?, ?, ?, ?)",
            [
                (key, fit.island, fit.generation, fit.error, fit.standard_error, fit.bar, values.tobytes())
                for key, fit, values in rows
            ],
        )

    def save_seen(self, nodes: Mapping[str, int], island: int, generation: int) -> None:
        """Sizes by canonical expression."""
        rows = [(canonical, island, generation, count) for canonical, count in nodes.items()]
        self._connection.executemany("INSERT INTO seen VALUES (?, ?, ?, ?)", rows)

    def save_confirmed(self, members: Iterable[Member], island: int, generation: int) -> None:
        rows = [(m.expression, island, generation, text_of(m)) for m in members]
        self._connection.executemany("INSERT INTO confirmed VALUES (?, ?, ?, ?)", rows)
        # Another island's fit of the same expression may be the one that was described.
        self._connection.executemany("DELETE FROM descriptions WHERE expression = ?", [(row[0],) for row in rows])

    def keep_confirmed(self, front: Front) -> None:
        """Drops what is not on a front."""
        kept = {member.expression for member in front.members}
        for table in ("confirmed", "descriptions"):
            there = {row[0] for row in self._connection.execute(f"SELECT expression FROM {table}")}
            self._connection.executemany(f"DELETE FROM {table} WHERE expression = ?", [(e,) for e in there - kept])

    def save_description(self, expression: str, description: Description, *, to_cull: bool = False) -> None:
        row = plain(description) | ({"culled": None} if to_cull else {})
        self._save_described(expression, row)

    def save_culled(self, expression: str, culled: Culled) -> None:
        """What is left of a member that is described."""
        query = "SELECT description FROM descriptions WHERE expression = ?"
        (text,) = self._connection.execute(query, (expression,)).fetchone()
        self._save_described(expression, json.loads(text) | {"culled": plain(culled)})

    def _save_described(self, expression: str, row: dict[str, Any]) -> None:
        self._connection.execute(
            "INSERT OR REPLACE INTO descriptions VALUES (?, ?)", (expression, json.dumps(row))
        )

    def save_quarantined(self, candidates: Iterable[Quarantined]) -> None:
        rows = [astuple(candidate) for candidate in candidates]
        self._connection.executemany("INSERT OR REPLACE INTO quarantine VALUES (?, ?, ?, ?, ?)", rows)

    def save_baseline(self, name: str, baseline: StoredBaseline) -> None:
        self._connection.execute("INSERT OR REPLACE INTO baselines VALUES (?, ?)", (name, text_of(baseline)))

    def save_transfer(self, model: str, material: str, transfer: Transfer) -> None:
        self._connection.execute(_TRANSFERS)
        self._connection.execute(
            "INSERT OR REPLACE INTO transfers VALUES (?, ?, ?)",
            (model, material, text_of(transfer)),
        )

    def save_generation(self, row: Generation) -> None:
        *values, stages, at, arrived = astuple(row)
        values.append(json.dumps({"stages": stages, "at": at, "arrived": arrived}))
        marks = ", ".join("?" * len(values))
        self._connection.execute(f"INSERT INTO generations VALUES ({marks})", values)

    def save_seconds(self, seconds: float) -> None:
        self.set_meta("seconds", str(seconds))

    def log(self, kind: str, detail: str) -> None:
        self._connection.execute("INSERT INTO events VALUES (?, ?, ?)", (time.time(), kind, detail))


def _connect(path: Path) -> sqlite3.Connection:
    connection = sqlite3.connect(path, timeout=10, isolation_level=None)
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("PRAGMA synchronous = NORMAL")
    return connection
