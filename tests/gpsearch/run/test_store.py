"""The run's SQLite file: it holds all to the last bit, and refuses with one sentence what it cannot hold."""

import json
import os
import sqlite3
from collections.abc import Iterator
from math import inf
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fitters.fitting import Description, Fit
from fitters.judging.checks import Checks
from gpsearch.errors import GpsearchError
from gpsearch.evolution.island import Individual, Island
from gpsearch.genomes import Delete, Genome, Insert, Replace, Swap
from gpsearch.run import (
    FormulaBaseline,
    Front,
    Generation,
    Known,
    Member,
    Quarantined,
    Store,
    TabulatedBaseline,
    Transfer,
    WritableStore,
)
from gpsearch.run.lock import RunLock
from gpsearch.run.records import plain
from tests.gpsearch.small import writing
from tests.unprivileged import unprivileged

FLOATS = st.floats(0, allow_nan=False)
EDITS = (Swap("a.0", "a.1"), Insert("a.0", "p0 / pi", "b"), Replace("b.1", "p1"), Delete("b.2", "c"))
GENOME = Genome("p0 * wh.z", EDITS)


@pytest.fixture
def store(tmp_path: Path) -> Iterator[WritableStore]:
    store = made(tmp_path / "run", "name: x\n")
    yield store
    left(store)


def made(folder: Path, configuration: str = "") -> WritableStore:
    """A new store, its run locked."""
    return WritableStore.create(RunLock(folder), configuration)


def left(store: WritableStore) -> None:
    store.close()
    store._lock.release()


def again(store: Store) -> Store:
    """What another process would read."""
    return Store.open(store.path.parent)


def fit(error: float, values: list[list[float]]) -> Fit:
    names = tuple(f"p{i}" for i in range(len(values[0])))
    return Fit(names, np.array(values).reshape(3, len(names)), np.full(3, error), error, 17)


def same(one: Fit, other: Fit) -> bool:
    return (
        (one.names, one.error, one.evaluations) == (other.names, other.error, other.evaluations)
        and one.values.shape == other.values.shape
        and one.values.tobytes() == other.values.tobytes()
        and one.errors.tobytes() == other.errors.tobytes()
    )


def test_a_new_store_is_empty(store):
    read = again(store)
    assert read.configuration == "name: x\n"
    assert (read.islands(), [*read.fits()], [*read.seen()], read.front().members) == ((), [], [], ())
    assert (read.totals(), read.seconds, read.events(), read.baselines()) == ((0, 0, 0), 0.0, [], {})


@settings(deadline=None, max_examples=30)
@given(errors=st.lists(FLOATS, min_size=1, max_size=5))
def test_islands_and_errors_come_back_to_the_last_bit(tmp_path_factory, errors):
    store = made(tmp_path_factory.mktemp("runs") / "run")
    population = tuple(Individual(GENOME, f"p{i}", 1, error) for i, error in enumerate(errors))
    islands = (Island(0, 3, population), Island(1, 3, population[::-1]))
    with store.transaction():
        store.save_islands(islands)
        fits = {i.expression: Known(i.error, 0.01, inf, 2, 3) for i in population}
        store.save_fits((key, fit, np.float32([[fit.error, 2.0]] * 3)) for key, fit in fits.items())
    read = again(store)
    assert read.islands() == islands
    assert dict(read.fits()) == fits
    found = read.parameters(fits | {"unknown": Known(0.5)}, 3)
    assert set(found) == set(fits)
    for name, values in found.items():
        np.testing.assert_array_equal(values, np.float32([[errors[int(name[1:])], 2.0]] * 3))
    read.close()
    left(store)


@settings(deadline=None, max_examples=30)
@given(error=st.floats(0, 1), screened=FLOATS, values=st.lists(st.floats(allow_nan=False), min_size=3, max_size=3))
def test_the_front_and_its_descriptions_come_back_to_the_last_bit(tmp_path_factory, error, screened, values):
    store = made(tmp_path_factory.mktemp("runs") / "run")
    member = Member("p0", 1, GENOME, 2, 7, fit(error, [[v] for v in values]), screened)
    described = Description(
        fit(error, [[v] for v in values]), {"light": error, "other": inf}, Checks(0, -1e300, inf), 0.1
    )
    with store.transaction():
        store.save_confirmed([member], 2, 7)
        store.save_description("p0", described)
        store.save_baseline("lambert", FormulaBaseline(described, 0.3))
    read = again(store)
    (found,) = read.front().members
    assert (found.genome, found.island, found.generation, found.screened) == (GENOME, 2, 7, screened)
    assert same(found.fit, member.fit)
    for description in (read.descriptions()["p0"], read.baselines()["lambert"].description):
        assert same(description.fit, described.fit)
        assert (description.metrics, description.checks) == (described.metrics, described.checks)
        assert description.cost_ns == 0.1
    read.close()
    left(store)


@settings(deadline=None, max_examples=30)
@given(errors=st.lists(FLOATS, min_size=3, max_size=3), seconds=FLOATS)
def test_a_reference_fit_comes_back_to_the_last_bit(tmp_path_factory, errors, seconds):
    baseline = TabulatedBaseline("table", {"light": tuple(errors)}, 24300, seconds, 0.1, ("metal: dark",))
    store = made(tmp_path_factory.mktemp("runs") / "run")
    with store.transaction():
        store.save_baseline("bivariate", baseline)
    read = again(store)
    assert read.baselines() == {"bivariate": baseline}
    read.close()
    left(store)


def test_a_baseline_stored_before_there_were_reference_fits_is_read(store):
    """Then a record of schema version 2 did not say its kind."""
    described = Description(fit(0.5, [[1.0], [2.0], [3.0]]), {"light": 0.5}, Checks(0, 0, 0), 1.5)
    text = json.dumps({"description": plain(described), "fit_seconds": 0.3})
    with store.transaction():
        store._connection.execute("INSERT INTO baselines VALUES ('lambert', ?)", (text,))
    read = again(store).baselines()["lambert"]
    assert isinstance(read, FormulaBaseline)
    assert same(read.description.fit, described.fit)
    assert (read.description.cost_ns, read.fit_seconds) == (1.5, 0.3)


def test_a_fit_without_parameters_comes_back(store):
    member = Member("1 / pi", 3, GENOME, 0, 1, Fit((), np.empty((3, 0)), np.full(3, 0.5), 0.5, 3), 0.5)
    with store.transaction():
        store.save_confirmed([member], 0, 1)
    assert same(again(store).front().members[0].fit, member.fit)


def test_members_that_leave_take_their_descriptions_along_and_others_keep_theirs(store):
    a, b = (Member(name, i + 1, GENOME, 0, 1, fit(0.5 - 0.1 * i, [[1.0]] * 3), 0.5) for i, name in enumerate("ab"))
    with store.transaction():
        store.save_confirmed([a, b], 0, 1)
        for name in "ab":
            store.save_description(name, Description(a.fit, {}, Checks(0, 0, 0), 1.0))
        store.keep_confirmed(Front((b,)))
    assert [m.expression for m in again(store).front().members] == ["b"]
    assert set(again(store).descriptions()) == {"b"}


def test_fits_are_added_and_never_changed(store):
    """Every island has its own, and each finds the parameters of the one that it means."""
    none, values = np.empty((3, 0), np.float32), np.float32([[1.0], [2.0], [3.0]])
    first, second = Known(0.5, 0.01, 0.3, 1, 4), Known(0.4, 0.02, inf, 0, 6)
    with store.transaction():
        store.save_fits([("p0", first, values), ("1 / pi", Known(inf, 0.0, inf, 1, 4), none)])
    with store.transaction():
        store.save_fits([("p0", second, 2 * values)])
    assert sorted(again(store).fits(), key=str) == sorted(
        [("p0", first), ("p0", second), ("1 / pi", Known(inf, 0.0, inf, 1, 4))], key=str
    )
    np.testing.assert_array_equal(again(store).parameters({"p0": first}, 3)["p0"], values)
    np.testing.assert_array_equal(again(store).parameters({"p0": second}, 3)["p0"], 2 * values)
    assert again(store).parameters({"1 / pi": Known(inf, 0.0, inf, 1, 4)}, 3)["1 / pi"].shape == (3, 0)
    with pytest.raises(GpsearchError, match="another gpsearch has gone on with this run"), store.transaction():
        store.save_fits([("p0", first, values)])


def test_sizes_come_back_with_who_saw_them(store):
    with store.transaction():
        store.save_seen({"p0": 7, "p1": 9}, island=1, generation=4)
        store.save_seen({"p0": 5}, island=0, generation=5)
    assert sorted(again(store).seen()) == [("p0", 0, 5, 5), ("p0", 1, 4, 7), ("p1", 1, 4, 9)]


def test_the_quarantine_comes_back(store):
    found = [
        Quarantined("ggx", "baseline", "raised ValueError: x"),
        Quarantined("p0", "screen", "its worker process died, 5 times", 1, 4),
    ]
    with store.transaction():
        store.save_quarantined(found)
    assert again(store).quarantined() == found


def test_the_history_comes_back(store):
    history = [
        Generation(0, 1, 16, 14, 3, 2, 0.5, 1.5, {"screening": 1.0}),
        Generation(0, 2, 16, 9, 0, 0, inf, 0.1, {}),
    ]
    with store.transaction():
        for generation in history:
            store.save_generation(generation)
    assert again(store).generations() == history
    assert again(store).totals() == (0, 32, 23)


def test_a_transaction_that_fails_leaves_nothing_behind(store):
    def broken_off() -> None:
        with store.transaction():
            store.save_seconds(12.0)
            store.log("launch", "x")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        broken_off()
    assert (again(store).seconds, again(store).events()) == (0.0, [])


def test_others_read_while_one_writes(store):
    with store.transaction():
        store.save_seconds(1.0)
    reader = again(store)
    with store.transaction():
        store.save_seconds(2.0)
        assert reader.seconds == 1.0
    assert reader.seconds == 2.0


def test_events_and_totals_add_up(store):
    with store.transaction():
        store.save_islands([Island(0, 2), Island(1, 1)])
        store.save_generation(Generation(0, 1, 16, 12, 3, 2, 0.5, 1.0, {}))
        store.save_generation(Generation(0, 2, 16, 10, 3, 2, 0.4, 1.0, {}))
        store.save_generation(Generation(1, 1, 16, 10, 3, 2, 0.4, 1.0, {}))
        store.log("launch", "here")
        store.log("end", "generations")
    assert again(store).totals() == (1, 48, 32)
    assert [(kind, detail) for _, kind, detail in again(store).events()] == [
        ("launch", "here"),
        ("end", "generations"),
    ]


def test_a_generation_that_another_process_has_stored_is_noticed(store):
    row = Generation(0, 1, 16, 12, 3, 2, 0.5, 1.0, {})
    with store.transaction():
        store.save_generation(row)
    with pytest.raises(GpsearchError, match="another gpsearch has gone on with this run"), store.transaction():
        store.save_generation(row)


def test_no_run_is_refused(tmp_path):
    with pytest.raises(GpsearchError, match=r"no run here \(run.sqlite is missing\); `gpsearch launch` makes one"):
        Store.open(tmp_path)
    with pytest.raises(GpsearchError, match="no run here"):
        Store.open(tmp_path / "missing")


@pytest.mark.parametrize("content", [b"", b"not a database, but long enough to look like one" * 40])
def test_a_foreign_file_is_refused_and_left_alone(tmp_path, content):
    (tmp_path / "run.sqlite").write_bytes(content)
    with pytest.raises(GpsearchError, match=r"not a readable run \(.*\)"):
        Store.open(tmp_path)
    if content:
        assert (tmp_path / "run.sqlite").read_bytes() == content


def test_a_damaged_file_is_refused(store, tmp_path):
    folder = store.path.parent
    store.close()
    content = bytearray((folder / "run.sqlite").read_bytes())
    content[4096:] = b"\xa5" * (len(content) - 4096)
    (folder / "run.sqlite").write_bytes(content)
    with pytest.raises(GpsearchError, match="not a readable run"):
        Store.open(folder)


def test_another_programs_database_is_refused(tmp_path):
    connection = sqlite3.connect(tmp_path / "run.sqlite")
    connection.execute("CREATE TABLE meta (key TEXT, value TEXT)")
    connection.execute("CREATE TABLE cats (name TEXT)")
    connection.commit()
    connection.close()
    with pytest.raises(GpsearchError, match="schema version is none"):
        Store.open(tmp_path)


@pytest.mark.parametrize("version", ["2", "4", "one"])
def test_another_schema_version_is_refused(store, version):
    with store.transaction():
        store.set_meta("schema", version)
        store.set_meta("package", "9.8.7")
    with pytest.raises(
        GpsearchError,
        match=rf"its schema version is {version}, this gpsearch \(.*\) reads 3; install gpsearch 9.8.7",
    ):
        again(store)


OTHER = Transfer((0.5,) * 3, {"light": 0.5}, {})

VERSION_3 = {
    "meta": "key value",
    "islands": "number generation population",
    "fits": "canonical island generation error standard_error bar parameters",
    "seen": "canonical island generation nodes",
    "confirmed": "expression island generation member",
    "descriptions": "expression description",
    "quarantine": "expression stage reason island generation",
    "baselines": "name baseline",
    "generations": "island generation candidates fitted given_up confirmed best seconds stages",
    "events": "time kind detail",
}


def test_the_tables_of_schema_version_3_stay_as_they_are(store):
    """Runs of this version lie on disks: other columns need another version."""
    assert (store.meta("schema"), columns(store)) == ("3", VERSION_3)


def columns(store: Store) -> dict[str, str]:
    """The columns of every table."""
    names = store._connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchall()
    return {
        name: " ".join(row[1] for row in store._connection.execute(f"PRAGMA table_info({name})"))
        for (name,) in names
    }


def test_transfers_have_a_table_of_their_own_made_when_the_first_is_stored(store):
    """So that a store of version 3 takes them whoever made it, and whoever knows of none reads on."""
    transfer = Transfer((0.1, inf, 0.3), {"light": inf, "other": 0.1}, {"p0": (1.0, 2.0, 1e-300)}, ("x: dark",))
    assert again(store).transfers() == {}
    with store.transaction():
        store.save_transfer("p0 * wh.z", "../x.bsdf", transfer)
        store.save_transfer("ggx", "../x.bsdf", transfer)
    with store.transaction():
        store.save_transfer("ggx", "../x.bsdf", OTHER)
    assert again(store).transfers() == {("p0 * wh.z", "../x.bsdf"): transfer, ("ggx", "../x.bsdf"): OTHER}
    assert columns(store) == VERSION_3 | {"transfers": "model material transfer"}
    assert store.meta("schema") == "3"


def test_a_transaction_that_fails_leaves_no_table_of_transfers(store):
    def broken_off() -> None:
        with store.transaction():
            store.save_transfer("ggx", "x.bsdf", OTHER)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        broken_off()
    assert again(store).transfers() == {}


def test_a_store_that_is_cleared_forgets_transfers_and_may_have_none(store):
    store.clear()
    with store.transaction():
        store.save_transfer("ggx", "x.bsdf", OTHER)
    store.clear()
    assert again(store).transfers() == {}


def test_a_store_is_there_whole_or_not_at_all(tmp_path, monkeypatch):
    """Killed while it makes its tables, a run has no store, and the next launch makes one."""

    def killed(self: Path, target: Path) -> None:
        raise KeyboardInterrupt

    with RunLock(tmp_path) as lock:
        monkeypatch.setattr(Path, "rename", killed)
        with pytest.raises(KeyboardInterrupt):
            WritableStore.create(lock, "")
        monkeypatch.undo()
        assert not (tmp_path / "run.sqlite").exists()
        WritableStore.create(lock, "again").close()
    assert Store.open(tmp_path).configuration == "again"


def read_only(folder: Path) -> None:
    folder.chmod(0o555)
    for above in folder.parents:
        if above.stat().st_uid == os.geteuid() and above != Path("/tmp"):
            above.chmod(above.stat().st_mode | 0o011)


def test_a_folder_that_cannot_be_written_is_refused(tmp_path):
    with RunLock(tmp_path) as lock:
        read_only(tmp_path)
        with (
            unprivileged(),
            pytest.raises(GpsearchError, match=r"the run cannot be stored there .*; choose another --run"),
        ):
            WritableStore.create(lock, "")


def test_a_folder_in_the_place_of_the_store_is_refused(tmp_path):
    (tmp_path / "run.sqlite").mkdir()
    with (
        RunLock(tmp_path) as lock,
        pytest.raises(GpsearchError, match=r"the run cannot be stored there .*; choose another --run"),
    ):
        WritableStore.create(lock, "")


def test_a_store_that_is_open_for_reading_cannot_write(store):
    """Neither has it methods to, nor does its connection."""
    read = again(store)
    assert not isinstance(read, WritableStore)
    with pytest.raises(sqlite3.OperationalError, match="readonly"):
        read._connection.execute("INSERT INTO meta VALUES ('x', 'y')")
    read.close()


def test_nothing_is_written_once_the_lock_is_released(store):
    store._lock.release()
    with pytest.raises(GpsearchError, match="the lock of the run was released"), store.transaction():
        store.save_seconds(1.0)
    assert again(store).seconds == 0.0


def test_writing_into_a_store_that_may_only_be_read_fails_in_one_sentence(store):
    store._connection.execute("PRAGMA query_only = ON")
    with (
        pytest.raises(GpsearchError, match=r"cannot be written .* the last whole generations are safe"),
        store.transaction(),
    ):
        store.save_seconds(1.0)


def test_a_run_that_may_only_be_read_is_read(store, tmp_path):
    """As on an archive: no file can be made beside it."""
    with store.transaction():
        store.save_seconds(12.0)
    folder = store.path.parent
    store.close()
    read_only(folder)
    with unprivileged():
        read = Store.open(folder)
        assert read.seconds == 12.0
        with pytest.raises(sqlite3.OperationalError, match="readonly"):
            read._connection.execute("INSERT INTO meta VALUES ('x', 'y')")
        read.close()


@pytest.mark.parametrize("kept", [0.0, 0.3, 0.7, 0.99])
def test_a_torn_log_costs_the_last_transactions_alone(store, tmp_path, kept):
    """A launcher killed, and its file system cut the end of the log: what was before it is there and whole."""
    for second in range(1, 200):
        with store.transaction():
            store.save_seconds(float(second))
            store.log("second", str(second))
    copied = tmp_path / "copied"
    copied.mkdir()
    log = (store.path.parent / "run.sqlite-wal").read_bytes()
    (copied / "run.sqlite").write_bytes(store.path.read_bytes())
    (copied / "run.sqlite-wal").write_bytes(log[: int(kept * len(log))])
    read = Store.open(copied)
    assert read.events()[-1:] == read.events()[int(read.seconds) - 1 :]
    assert read._connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    assert kept < 0.9 or read.seconds > 100
    read.close()
    with writing(copied) as goes_on, goes_on.transaction():
        goes_on.save_seconds(1000.0)
    assert Store.open(copied).seconds == 1000.0
