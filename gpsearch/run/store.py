"""The store of a run: one SQLite file with all that the run needs to go on.

One process writes (WAL, a transaction per generation of an island), any number may read. It holds the state of
every island after its last whole generation; nothing in it is pickled. Fits and confirmed candidates are only ever
added, with their island and generation, so that what an island knew at any time can be told from them.
"""

import json
import os
import sqlite3
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fitters.fitting import Description
from fitters.fitting.culling import Culled
from fitters.models import Baseline
from gpsearch import __version__
from gpsearch.errors import GpsearchError, StoreError
from gpsearch.evolution.island import Island
from gpsearch.run.front import Front, Member
from gpsearch.run.known import Known
from gpsearch.run.records import (
    baseline_json,
    culled_json,
    description_json,
    member_json,
    population_text,
    read_baseline,
    read_culled,
    read_description,
    read_individual,
    read_member,
    read_stages,
    read_transfer,
    transfer_json,
)
from gpsearch.run.transfers import Transfer

SCHEMA_VERSION = 3
FILE = "run.sqlite"

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
                    "package": __version__,
                }
                connection.executemany("INSERT INTO meta VALUES (?, ?)", values.items())
            # The log of a store that someone took away would be replayed into this one.
            for left in ("-wal", "-shm"):
                path.with_name(path.name + left).unlink(missing_ok=True)
            part.rename(path)
            return cls(path, _connect(path))
        except (OSError, sqlite3.Error) as error:
            raise GpsearchError(
                f"{path}: the run cannot be stored there ({error}); choose another --run"
            ) from None

    @classmethod
    def open(cls, folder: Path) -> "Store":
        """The store of a run that is there, also where it may only be read.

        Raises `GpsearchError` for no run, a foreign or a newer file.
        """
        path = folder / FILE
        if not path.is_file():
            raise GpsearchError(f"{folder}: no run here ({FILE} is missing); `gpsearch launch` makes one")
        try:
            connection = (
                _connect(path) if os.access(folder, os.W_OK, effective_ids=True) else _connect_read_only(path)
            )
            found = connection.execute("SELECT value FROM meta WHERE key = 'schema'").fetchone()
        except sqlite3.Error as error:
            raise GpsearchError(
                f"{path}: not a readable run ({error}); restore it or choose another --run"
            ) from None
        if found is None or found[0] != str(SCHEMA_VERSION):
            version = "none" if found is None else found[0]
            raise GpsearchError(
                f"{path}: its schema version is {version}, this gpsearch ({__version__}) reads {SCHEMA_VERSION};"
                f" {_whom_to_install(connection)}"
            )
        return cls(path, connection)

    def clear(self) -> None:
        """Forgets all but what kind of store this is."""
        with self.transaction():
            for table in (*TABLES, *(("transfers",) if self._has_transfers else ())):
                self._connection.execute(f"DELETE FROM {table}")
            self._connection.execute("DELETE FROM meta WHERE key IN ('seconds', 'migrations')")

    def close(self) -> None:
        self._connection.close()

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """All or nothing of what is written inside. Raises `StoreError` where the disk refuses."""
        try:
            if self._connection.in_transaction:
                # A signal came between the end of the last one and its commitment.
                self._connection.rollback()
            with self._connection:
                self._connection.execute("BEGIN IMMEDIATE")
                yield
        except sqlite3.IntegrityError as error:
            # Fits and generations are only ever added: whatever is there already, someone else has found.
            raise GpsearchError(
                f"{self.path}: another gpsearch has gone on with this run ({error}): leave it to one of them, and"
                " to one version"
            ) from None
        except sqlite3.Error as error:
            raise StoreError(
                f"{self.path}: cannot be written ({error}); the last whole generations are safe: make room or mend"
                " the disk, and the same command goes on from there"
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

    def island_generations(self) -> dict[int, int]:
        """What every island has reached, by its number."""
        return dict(self._connection.execute("SELECT number, generation FROM islands ORDER BY number"))

    def save_islands(self, islands: Iterable[Island]) -> None:
        rows = [(island.number, island.generation, population_text(island.population)) for island in islands]
        self._connection.executemany("INSERT OR REPLACE INTO islands VALUES (?, ?, ?)", rows)

    @property
    def migrations(self) -> int:
        """How often the islands have exchanged what they know."""
        return int(self.meta("migrations") or 0)

    def save_migrations(self, count: int) -> None:
        self.set_meta("migrations", str(count))

    # fits

    def fits(self) -> Iterator[tuple[str, Known]]:
        """Every fit with its canonical expression; of some expressions there are several."""
        query = "SELECT canonical, error, standard_error, bar, island, generation FROM fits"
        for canonical, *known in self._connection.execute(query):
            yield canonical, Known(*known)

    def parameters(self, fits: Mapping[str, Known], targets: int) -> dict[str, NDArray[np.float32]]:
        """Parameters (targets, parameters) of stored fits, by canonical expression."""
        query = "SELECT parameters FROM fits WHERE canonical = ? AND island = ? AND generation = ?"
        found = {}
        for canonical, known in fits.items():
            row = self._connection.execute(query, (canonical, known.island, known.generation)).fetchone()
            if row is not None:
                found[canonical] = np.frombuffer(row[0], np.float32).reshape(targets, -1)
        return found

    def save_fits(self, rows: Iterable[tuple[str, Known, NDArray[np.float32]]]) -> None:
        """Canonical expressions, fits and their parameters."""
        self._connection.executemany(
            "INSERT INTO fits VALUES (?, ?, ?, ?, ?, ?, ?)",
            [
                (key, fit.island, fit.generation, fit.error, fit.standard_error, fit.bar, values.tobytes())
                for key, fit, values in rows
            ],
        )

    def seen(self) -> Iterator[tuple[str, int, int, int]]:
        """(canonical expression, island, generation, nodes) of whatever was new to an island, or smaller."""
        yield from self._connection.execute("SELECT canonical, island, generation, nodes FROM seen")

    def save_seen(self, nodes: Mapping[str, int], island: int, generation: int) -> None:
        """Sizes by canonical expression."""
        rows = [(canonical, island, generation, count) for canonical, count in nodes.items()]
        self._connection.executemany("INSERT INTO seen VALUES (?, ?, ?, ?)", rows)

    # the front and its descriptions

    def confirmed(self) -> list[tuple[int, int, Member]]:
        """(island, generation, candidate) of what was confirmed; what is beaten by others is dropped in time."""
        rows = self._connection.execute("SELECT island, generation, member FROM confirmed")
        return [(island, generation, read_member(json.loads(text))) for island, generation, text in rows]

    def front(self) -> Front:
        return Front().updated(member for _, _, member in self.confirmed())

    def save_confirmed(self, members: Iterable[Member], island: int, generation: int) -> None:
        rows = [(m.expression, island, generation, json.dumps(member_json(m))) for m in members]
        self._connection.executemany("INSERT INTO confirmed VALUES (?, ?, ?, ?)", rows)
        # Another island's fit of the same expression may be the one that was described.
        self._connection.executemany("DELETE FROM descriptions WHERE expression = ?", [(row[0],) for row in rows])

    def keep_confirmed(self, front: Front) -> None:
        """Drops what is not on a front."""
        kept = {member.expression for member in front.members}
        for table in ("confirmed", "descriptions"):
            there = {row[0] for row in self._connection.execute(f"SELECT expression FROM {table}")}
            self._connection.executemany(f"DELETE FROM {table} WHERE expression = ?", [(e,) for e in there - kept])

    def descriptions(self) -> dict[str, Description]:
        """What is known in full of front members, by expression."""
        rows = self._connection.execute("SELECT expression, description FROM descriptions")
        return {expression: read_description(json.loads(text)) for expression, text in rows}

    def culled(self) -> dict[str, Culled | None]:
        """What is left of described members, by expression; None of those that are still to be culled.

        Members that are not to be culled, as in runs of versions without culling, do not occur.
        """
        rows = self._connection.execute("SELECT expression, description FROM descriptions")
        stored = {expression: json.loads(text) for expression, text in rows}
        due = {expression: row["culled"] for expression, row in stored.items() if "culled" in row}
        return {expression: row and read_culled(row) for expression, row in due.items()}

    def save_description(self, expression: str, description: Description, *, to_cull: bool = False) -> None:
        row = description_json(description) | ({"culled": None} if to_cull else {})
        self._save_described(expression, row)

    def save_culled(self, expression: str, culled: Culled) -> None:
        """What is left of a member that is described."""
        query = "SELECT description FROM descriptions WHERE expression = ?"
        (text,) = self._connection.execute(query, (expression,)).fetchone()
        self._save_described(expression, json.loads(text) | {"culled": culled_json(culled)})

    def _save_described(self, expression: str, row: dict[str, Any]) -> None:
        self._connection.execute(
            "INSERT OR REPLACE INTO descriptions VALUES (?, ?)", (expression, json.dumps(row))
        )

    # quarantine

    def quarantined(self) -> list[Quarantined]:
        rows = self._connection.execute(
            "SELECT expression, stage, reason, island, generation FROM quarantine ORDER BY generation, island"
        )
        return [Quarantined(*row) for row in rows]

    def save_quarantined(self, candidates: Iterable[Quarantined]) -> None:
        rows = [astuple(candidate) for candidate in candidates]
        self._connection.executemany("INSERT OR REPLACE INTO quarantine VALUES (?, ?, ?, ?, ?)", rows)

    # baselines

    def baselines(self) -> dict[str, Baseline]:
        """The baselines that are fitted, by name."""
        rows = self._connection.execute("SELECT name, baseline FROM baselines ORDER BY name")
        return {name: read_baseline(json.loads(text)) for name, text in rows}

    def save_baseline(self, name: str, baseline: Baseline) -> None:
        text = json.dumps(baseline_json(baseline))
        self._connection.execute("INSERT OR REPLACE INTO baselines VALUES (?, ?)", (name, text))

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
        return {(model, material): read_transfer(json.loads(text)) for model, material, text in rows}

    def save_transfer(self, model: str, material: str, transfer: Transfer) -> None:
        self._connection.execute(_TRANSFERS)
        self._connection.execute(
            "INSERT OR REPLACE INTO transfers VALUES (?, ?, ?)",
            (model, material, json.dumps(transfer_json(transfer))),
        )

    # history

    def save_generation(self, row: Generation) -> None:
        *values, stages, at, arrived = astuple(row)
        values.append(json.dumps({"stages": stages, "at": at, "arrived": arrived}))
        marks = ", ".join("?" * len(values))
        self._connection.execute(f"INSERT INTO generations VALUES ({marks})", values)

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

    def save_seconds(self, seconds: float) -> None:
        self.set_meta("seconds", str(seconds))

    def log(self, kind: str, detail: str) -> None:
        self._connection.execute("INSERT INTO events VALUES (?, ?, ?)", (time.time(), kind, detail))

    def events(self) -> list[tuple[float, str, str]]:
        """(seconds since the epoch, kind, detail), oldest first."""
        return list(self._connection.execute("SELECT time, kind, detail FROM events ORDER BY rowid"))


def _whom_to_install(connection: sqlite3.Connection) -> str:
    """What reads a store of another schema version."""
    try:
        found = connection.execute("SELECT value FROM meta WHERE key = 'package'").fetchone()
    except sqlite3.Error:
        found = None
    written = f"gpsearch {found[0]}, which wrote it" if found else "the version of gpsearch that wrote it"
    return f"install {written}, or name another directory with --run"


def _connect(path: Path) -> sqlite3.Connection:
    connection = sqlite3.connect(path, timeout=10, isolation_level=None)
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("PRAGMA synchronous = NORMAL")
    return connection


def _connect_read_only(path: Path) -> sqlite3.Connection:
    """A connection that cannot write, nor make files beside the store.

    Where no log is there that it could read, the store itself is all there is, and does not change.
    """
    address = f"{path.absolute().as_uri()}?mode=ro"
    connection = sqlite3.connect(address, timeout=10, isolation_level=None, uri=True)
    try:
        connection.execute("SELECT 1 FROM meta").fetchone()
    except sqlite3.OperationalError:
        connection.close()
        connection = sqlite3.connect(f"{address}&immutable=1", timeout=10, isolation_level=None, uri=True)
    return connection
