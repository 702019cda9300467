"""The same front, whatever happens: real processes are killed at random moments, which are printed.

`pytest tests/chaos` takes a few minutes; `--chaos N` makes N rounds of it, `--chaos-seed S` repeats the moments.
"""

from __future__ import annotations

import os
import random
import shutil
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil
import pytest

from gpsearch.front import Store
from tests.chaos.actors import Cluster, Launcher
from tests.chaos.tally import TALLY
from tests.gpsearch.small import small_text, without_times

pytestmark = pytest.mark.slow

GENERATIONS, ISLANDS = 6, 3


def text(**executor: object) -> str:
    """A search of some seconds whose islands meet twice."""
    return small_text(
        executor=executor or {"kind": "local"},
        materials=["builtin:metal", "builtin:fabric"],
        budget={"generations": GENERATIONS},
        search={"islands": ISLANDS, "island_size": 12, "migrate_every": 2},
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
        config = metafunc.config
        seed = config.getoption("--chaos-seed")
        first = int.from_bytes(os.urandom(3), "big") if seed is None else seed
        metafunc.parametrize("chance", [first + i for i in range(config.getoption("--chaos"))], indirect=True)


@pytest.fixture
def chance(request: pytest.FixtureRequest) -> random.Random:
    return random.Random(request.param)


class Scene:
    """A cluster, a launcher, and the clock since the launch."""

    def __init__(self, folder: Path, chance: random.Random, name: str, cache: Path | None = None) -> None:
        self.cluster, self.chance, self.name = Cluster(folder / "cluster"), chance, name
        (folder / "chaos.yaml").write_text(text(kind="dask", scheduler=self.cluster.address, wait_seconds=60))
        self.launcher = Launcher(folder, "chaos.yaml", "run", cache)
        self.began = time.monotonic()
        self.launches = 0

    def launch(self) -> None:
        self.launches += 1
        self.launcher.start()

    def at_random(self, low: float, high: float) -> None:
        """Waits a random time, or for the end of the launcher."""
        deadline = time.monotonic() + self.chance.uniform(low, high)
        while time.monotonic() < deadline and not self.launcher.ended:
            time.sleep(0.01)

    def blow(self, what: str) -> None:
        TALLY.blows[what] += 1
        stored = len(self.launcher.stored())
        moment = (
            f"{self.name}: {what} {time.monotonic() - self.began:.2f} s after the launch, {stored} generations"
        )
        TALLY.moments.append(moment)
        print(moment)

    def kill_worker(self) -> None:
        workers = self.cluster.workers()
        if workers and not self.launcher.ended:
            try:
                self.chance.choice(workers).kill()
                self.blow("workers killed")
            except psutil.NoSuchProcess:
                pass


@contextmanager
def scene(folder: Path, chance: random.Random, name: str, workers: int) -> Iterator[Scene]:
    made = Scene(folder, chance, name)
    with made.cluster:
        made.cluster.start_workers(workers)
        made.launch()
        try:
            yield made
        finally:
            if not made.launcher.ended:
                made.launcher.kill()


def require_same_front(launcher: Launcher, reference: str) -> None:
    """The launcher comes to its end, with the same front, and with every generation once."""
    assert launcher.end() == 0, launcher.log.read_text()
    TALLY.runs += 1
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


def test_workers_killed_in_mid_task_again_and_again(tmp_path, reference, chance):
    with scene(tmp_path, chance, "workers", 2) as staged:
        staged.launcher.wait_until_stored(1)
        while not staged.launcher.ended:
            staged.at_random(0.3, 2.5)
            staged.kill_worker()
        require_same_front(staged.launcher, reference)


def test_all_workers_gone_and_new_ones_joining(tmp_path, reference, chance):
    with scene(tmp_path, chance, "all workers", 2) as staged:
        for _ in range(2):
            staged.at_random(3.0, 7.0)
            if staged.launcher.ended:
                break
            staged.cluster.kill_workers()
            staged.blow("times all workers gone")
            staged.at_random(0.0, 2.0)
            staged.cluster.start_workers(chance.choice([1, 2, 3]))
        require_same_front(staged.launcher, reference)


def test_the_scheduler_killed_and_restarted(tmp_path, reference, chance):
    """Its workers find the new one, or others join."""
    with scene(tmp_path, chance, "scheduler", 2) as staged:
        for _ in range(2):
            staged.at_random(3.0, 7.0)
            if staged.launcher.ended:
                break
            staged.cluster.kill_scheduler()
            staged.blow("schedulers killed")
            staged.at_random(0.0, 2.0)
            staged.cluster.start_scheduler()
            staged.cluster.kill_workers()
            staged.cluster.start_workers(2)
        require_same_front(staged.launcher, reference)


def test_the_launcher_killed_and_started_again(tmp_path, reference, chance):
    with scene(tmp_path, chance, "launcher", 2) as staged:
        for _ in range(4):
            staged.at_random(0.5, 6.0)
            if staged.launcher.ended:
                break
            staged.launcher.kill()
            staged.blow("launchers killed")
            safe = staged.launcher.stored()
            staged.launch()
            kept = staged.launcher.stored()
            TALLY.generations_safe += len(safe & kept)
            TALLY.generations_lost += len(safe - kept)
            assert safe <= kept
        require_same_front(staged.launcher, reference)


def test_the_launcher_stopped_at_the_end_of_its_walltime(tmp_path, reference, chance):
    with scene(tmp_path, chance, "walltime", 2) as staged:
        for _ in range(3):
            staged.at_random(2.0, 5.0)
            if staged.launcher.ended:
                break
            status = staged.launcher.stop()
            staged.blow("launchers terminated")
            assert status in (143, -signal.SIGTERM), staged.launcher.log.read_text()
            staged.launch()
        require_same_front(staged.launcher, reference)


def test_the_disk_cache_deleted_in_between(tmp_path, reference, chance):
    """Materials, light and compiled engine are made anew; in one process, since that takes a minute of it."""
    cache = tmp_path / "cache"
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


def test_everything_at_once(tmp_path, reference, chance):
    with scene(tmp_path, chance, "storm", 3) as staged:
        deadline = time.monotonic() + 40
        while not staged.launcher.ended and time.monotonic() < deadline:
            staged.at_random(0.5, 3.0)
            match chance.randrange(6):
                case 0:
                    staged.launcher.kill()
                    staged.blow("launchers killed")
                    staged.launch()
                case 1:
                    staged.cluster.kill_scheduler()
                    staged.blow("schedulers killed")
                    staged.cluster.start_scheduler()
                    staged.cluster.kill_workers()
                    staged.cluster.start_workers(chance.choice([1, 2, 3]))
                case _:
                    staged.kill_worker()
        require_same_front(staged.launcher, reference)
