"""The same front, whatever happens: real processes are killed at random moments, which are printed.

`pytest tests/chaos --long` takes some minutes: the storm and two more of the blows, drawn anew each time.
`--chaos N` makes N rounds of all of them, `--chaos-seed S` repeats draw and moments.
"""

from __future__ import annotations

import random
import shutil
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil
import pytest

import fitters.cache
from gpsearch.run import Store
from tests.chaos.actors import Cluster, Launcher
from tests.chaos.tally import TALLY
from tests.gpsearch.small import small_text, without_times
from workers.dispatch.replay import replay

pytestmark = pytest.mark.long

GENERATIONS, ISLANDS = 6, 3


def text(**executor: object) -> str:
    """A search of some seconds whose islands meet twice."""
    return small_text(
        executor=executor or {"kind": "local"},
        materials=["builtin:metal", "builtin:fabric"],
        budget={"generations": GENERATIONS},
        search={"islands": ISLANDS, "island_size": 24, "migrate_every": 2},
        baselines=["lambert", "power-iterations"],
    )


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The front of a run in one process that nobody disturbs."""
    folder = tmp_path_factory.mktemp("reference")
    (folder / "chaos.yaml").write_text(text())
    launcher = Launcher(folder, "chaos.yaml", "run")
    launcher.start()
    assert launcher.end() == 0, launcher.log.read_text()
    return without_times(folder / "run" / "front.json")


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "chance" in metafunc.fixturenames:
        first, rounds = metafunc.config.getoption("--chaos-seed"), max(metafunc.config.getoption("--chaos"), 1)
        metafunc.parametrize("chance", [first + i for i in range(rounds)], indirect=True)


@pytest.fixture
def chance(request: pytest.FixtureRequest) -> random.Random:
    return random.Random(request.param)


class Scene:
    """A cluster, a launcher, and the clock since the first launch."""

    def __init__(self, folder: Path, chance: random.Random, name: str) -> None:
        self.cluster, self.chance, self.name = Cluster(folder / "cluster"), chance, name
        (folder / "chaos.yaml").write_text(text(kind="dask", scheduler=self.cluster.address, wait_seconds=60))
        self.launcher = Launcher(folder, "chaos.yaml", "run")
        self.began = time.monotonic()

    def moments(self, count: int) -> Iterator[None]:
        """So many random moments of a run, from its start to shortly before its end, while it lasts."""
        whole = ISLANDS * GENERATIONS
        for generations in sorted(self.chance.randrange(whole) for _ in range(count)):
            self.launcher.wait_until_stored(generations)
            deadline = time.monotonic() + self.chance.uniform(0.0, 1.0)
            while time.monotonic() < deadline and not self.launcher.ended:
                time.sleep(0.01)
            if self.launcher.ended:
                return
            yield

    def blow(self, what: str) -> None:
        after, stored = time.monotonic() - self.began, len(self.launcher.stored())
        moment = f"{self.name}: {what} {after:.2f} s after the launch, {stored} generations stored"
        TALLY.blows[what] += 1
        TALLY.moments.append(moment)
        print(moment)

    def kill_worker(self) -> None:
        with suppress(psutil.NoSuchProcess, IndexError):
            self.chance.choice(self.cluster.workers()).kill()
            self.blow("workers killed")

    def kill_launcher(self) -> None:
        """It is started again and has lost nothing."""
        self.launcher.kill()
        self.blow("launchers killed")
        self._launch_again()

    def stop_launcher(self) -> None:
        """It leaves a checkpoint, says so by its exit status, and is started again."""
        status = self.launcher.stop()
        self.blow("launchers terminated")
        # Python's own end by the signal, where it came before there was anything to write down.
        assert status in (143, -signal.SIGTERM), self.launcher.log.read_text()
        self._launch_again()

    def _launch_again(self) -> None:
        safe = self.launcher.stored()
        self.launcher.start()
        self.launcher.wait_until_stored(len(safe) + 1)
        kept = self.launcher.stored()
        TALLY.generations_safe += len(safe & kept)
        TALLY.generations_lost += len(safe - kept)
        assert safe <= kept

    def restart_scheduler(self) -> None:
        """Somewhat later, and with new workers."""
        self.cluster.kill_scheduler()
        self.blow("schedulers killed")
        time.sleep(self.chance.uniform(0.0, 2.0))
        self.cluster.start_scheduler()
        self.cluster.kill_workers()
        self.cluster.start_workers(self.chance.choice([1, 2, 3]))

    def replace_workers(self) -> None:
        self.cluster.kill_workers()
        self.blow("clusters emptied")
        time.sleep(self.chance.uniform(0.0, 2.0))
        self.cluster.start_workers(self.chance.choice([1, 2, 3]))


@contextmanager
def scene(folder: Path, chance: random.Random, name: str, workers: int) -> Iterator[Scene]:
    made = Scene(folder, chance, name)
    with made.cluster:
        made.cluster.start_workers(workers)
        made.launcher.start()
        try:
            yield made
        finally:
            if not made.launcher.ended:
                made.launcher.kill()


def require_same_front(launcher: Launcher, reference: str) -> None:
    """The launcher comes to its end, with the same front, and with every generation once."""
    assert launcher.end() == 0, launcher.log.read_text()
    TALLY.runs += 1
    for log in launcher.dispatch.glob("*.jsonl"):
        with log.open() as lines:
            assert [event for event, before, now in replay(lines) if before != now] == []
    store = Store.open(launcher.run)
    rows, events = store.generations(), store.events()
    assert store.quarantined() == []
    store.close()
    assert [(row.island, row.generation) for row in rows] == [
        (island, generation) for generation in range(1, GENERATIONS + 1) for island in range(ISLANDS)
    ]
    TALLY.retries += sum(int(detail) for _, kind, detail in events if kind == "retry")
    assert without_times(launcher.run / "front.json") == reference, launcher.log.read_text()
    TALLY.identical += 1


@pytest.mark.parametrize("workers", [1, 4])
def test_any_number_of_workers(tmp_path, reference, workers):
    with scene(tmp_path, random.Random(), f"{workers} workers", workers) as staged:
        require_same_front(staged.launcher, reference)


BLOWS: dict[str, tuple[int, list[Callable[[Scene], None]]]] = {
    "workers killed again and again": (6, [Scene.kill_worker]),
    "all workers gone, new ones joining": (2, [Scene.replace_workers]),
    "the scheduler killed": (2, [Scene.restart_scheduler]),
    "the launcher killed": (3, [Scene.kill_launcher]),
    "the launcher at the end of its walltime": (2, [Scene.stop_launcher]),
    "a storm": (
        6,
        [Scene.kill_worker, Scene.kill_worker, Scene.restart_scheduler, Scene.kill_launcher, Scene.stop_launcher],
    ),
}
"""How many blows, of which kinds."""


@pytest.mark.parametrize("name", BLOWS)
def test_the_same_front_whatever_happens(tmp_path, reference, chance, name):
    count, kinds = BLOWS[name]
    with scene(tmp_path, chance, name, 2) as staged:
        for _ in staged.moments(count):
            chance.choice(kinds)(staged)
        require_same_front(staged.launcher, reference)


def test_the_disk_cache_deleted_in_between(tmp_path, reference, chance):
    """Materials, light and compiled engine are made anew; in one process, since that takes a minute of it."""
    cache = tmp_path / "cache"
    with suppress(FileNotFoundError):
        shutil.copytree(fitters.cache.folder(), cache)
    (tmp_path / "chaos.yaml").write_text(text())
    launcher = Launcher(tmp_path, "chaos.yaml", "run", cache)
    launcher.start()
    launcher.wait_until_stored(chance.randrange(1, ISLANDS * GENERATIONS))
    launcher.kill()
    shutil.rmtree(cache)
    moment = f"cache: deleted after {len(launcher.stored())} generations, with a launcher that was killed"
    TALLY.moments.append(moment)
    TALLY.blows["disk caches deleted"] += 1
    launcher.start()
    launcher.wait_until_stored(len(launcher.stored()) + 1)
    shutil.rmtree(cache)
    TALLY.blows["disk caches deleted"] += 1
    require_same_front(launcher, reference)
