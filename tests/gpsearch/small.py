"""A search small enough for a test: one built-in material on few cells, sixteen candidates a generation."""

import atexit
import io
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import chdir, closing, contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import OpenImageIO as oiio
import yaml

from gpsearch.commands import main
from gpsearch.configuration import Configuration, parse_configuration
from gpsearch.run import Store, WritableStore
from gpsearch.run.identity import identify
from gpsearch.run.lock import RunLock
from gpsearch.search.plan import plan
from gpsearch.search.search import Search, SearchStatus
from workers import Executor, Incident
from workers.local import LocalExecutor

GPSEARCH = str(Path(sys.executable).with_name("gpsearch"))
PATIENCE_SECONDS = 120


def lamp() -> str:
    """The path of a light that falls from about the viewer: it lights a sixth of all cells."""
    folder = tempfile.mkdtemp()
    atexit.register(shutil.rmtree, folder)
    rows, columns = np.mgrid[:32, :64]
    away = np.hypot(rows - 15.5, columns - 31.5) * 180 / 32
    radiance = np.where(away < 22, 1 + away / 10, 0)[..., None] * np.array([1.0, 0.9, 0.8])
    path = str(Path(folder) / "lamp.exr")
    output = oiio.ImageOutput.create(path)
    output.open(path, oiio.ImageSpec(64, 32, 3, "float"))
    output.write_image(radiance.astype(np.float32))
    output.close()
    return path


LAMP = lamp()

SMALL: dict[str, Any] = {
    "name": "small",
    "seed": 5,
    "materials": ["builtin:metal"],
    "scene": {"light": LAMP, "resolution": 16, "light_rows": 8},
    "budget": {"generations": 4},
    "search": {"start": ["phong"], "islands": 2, "island_size": 8, "migrate_every": 2, "max_nodes": 40},
    "fit": {"cells": 256, "confirm_cells": 1024},
    "culling": 0,
    "baselines": ["lambert"],
}

FEW: dict[str, Any] = {"islands": 1, "island_size": 6}
"""A search section for tests that need a front, of whatever formulas: three of them are on it."""


def small_text(**changes: Any) -> str:
    """The YAML of `SMALL` with whole sections replaced or, where they are mappings, updated."""
    merged = dict(SMALL)
    for key, value in changes.items():
        merged[key] = {**merged.get(key, {}), **value} if isinstance(value, dict) else value
    return yaml.safe_dump(merged, sort_keys=False)


def small(folder: Path, **changes: Any) -> Configuration:
    return parse_configuration(small_text(**changes), source="small.yaml", folder=folder)


class Watching:
    """A watcher that remembers what it was told and calls `then` with every event's name."""

    def __init__(self, then: Callable[[str], None] = lambda event: None) -> None:
        self.stages: list[tuple[str, int | None]] = []
        self.incidents: list[Incident] = []
        self.statuses: list[SearchStatus] = []
        self.steps = 0
        self.then = then

    def stage(self, name: str, total: int | None) -> None:
        self.stages.append((name, total))
        self.then(name)

    def step(self, count: int) -> None:
        self.steps += count
        self.then("step")

    def generation(self, status: SearchStatus) -> None:
        self.statuses.append(status)
        self.then(f"stored {status.generation}")

    def incident(self, incident: Incident) -> None:
        self.incidents.append(incident)
        self.then("incident")


def run_search(
    folder: Path,
    configuration: Configuration,
    watcher: Watching | None = None,
    executor: Executor | None = None,
) -> Store:
    """Runs or goes on with a search in a folder, in this process by default; its store, for reading."""
    if not (folder / "run.sqlite").exists():
        make_store(folder, configuration.text())
    with writing(folder) as store:
        identify(store, configuration)
        Search(plan(configuration), store, executor or LocalExecutor(), watcher or Watching()).run()
    return Store.open(folder)


def make_store(folder: Path, configuration: str) -> Path:
    """Makes a run directory without generations."""
    with RunLock(folder) as lock:
        WritableStore.create(lock, configuration).close()
    return folder


@contextmanager
def writing(folder: Path) -> Iterator[WritableStore]:
    """The store of a run directory under its lock."""
    with RunLock(folder) as lock, closing(WritableStore.of(lock)) as store:
        yield store


def without_times(exported: dict[str, Any] | Path) -> str:
    """The text of an export, or of the file that holds one, with every measured time set to 0."""
    if isinstance(exported, Path):
        exported = json.loads(exported.read_text())
    copy = json.loads(json.dumps(exported))
    copy["run"]["seconds"] = 0
    for entry in copy["front"] + copy["baselines"]:
        entry["cost_ns"] = 0
        if "fit_seconds" in entry:
            entry["fit_seconds"] = 0
    return json.dumps(copy, indent=1)


def gpsearch(*arguments: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    """The command in this process, which spares it the imports; an exception that it lets out is ours."""
    out, err, command = io.StringIO(), io.StringIO(), ["gpsearch", *map(str, arguments)]
    status = 0
    with chdir(cwd), patch("sys.argv", command), redirect_stdout(out), redirect_stderr(err):
        try:
            main()
        except SystemExit as end:
            status = int(end.code or 0)
    return subprocess.CompletedProcess(command, status, out.getvalue(), err.getvalue())


def gpsearch_process(*arguments: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    """The installed command in a process of its own, run to its end, its output captured as text."""
    return subprocess.run(
        [GPSEARCH, *map(str, arguments)],
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=PATIENCE_SECONDS,
        check=False,
    )
