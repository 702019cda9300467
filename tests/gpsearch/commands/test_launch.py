"""`gpsearch launch` as a person at the terminal meets it."""

import json
import re
import shutil
import signal
import socket
import sqlite3
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import jsonschema
import pytest

from fitters.materials import load_material
from fitters.materials.merl import FILE_BYTES, HEADER, write_merl
from fitters.scenes import geometries, sampled
from gpsearch.exports import schema
from gpsearch.run import Store
from gpsearch.run.lock import holder
from tests.gpsearch.small import (
    GPSEARCH,
    PATIENCE_SECONDS,
    gpsearch,
    gpsearch_process,
    small_text,
    without_times,
)

BALL = (
    '<scene version="3.0.0"><sensor type="orthographic"><transform name="to_world">'
    '<lookat origin="0,0,4" target="0,0,0" up="0,1,0"/></transform><film type="hdrfilm">'
    '<integer name="width" value="16"/><integer name="height" value="16"/></film></sensor>'
    '<shape type="sphere" id="ball"/></scene>'
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "small.yaml").write_text(small_text())
    return tmp_path


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, subprocess.CompletedProcess[str]]:
    """A run never stopped, in folder/runs/small."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "small.yaml").write_text(small_text())
    return folder, gpsearch_process("launch", "small.yaml", cwd=folder)


@pytest.fixture(scope="module")
def many_generations(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    """A configuration whose search lasts some seconds, and the front.json of a run never stopped."""
    folder, text = tmp_path_factory.mktemp("many"), small_text(budget={"generations": 40})
    (folder / "small.yaml").write_text(text)
    assert gpsearch_process("launch", "small.yaml", cwd=folder).returncode == 0
    return text, folder / "runs/small/front.json"


@contextmanager
def launched(folder: Path, run: str = "run") -> Iterator[subprocess.Popen[str]]:
    """A launch into folder/run under way, its terminal output readable line by line."""
    command = [GPSEARCH, "launch", "small.yaml", "--run", run]
    with subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def wait_for(stream: IO[str] | None, start: str) -> str:
    assert stream is not None
    lines = []
    for line in stream:
        lines.append(line)
        if line.startswith(start):
            return line
    raise AssertionError(f"no line starts with {start!r} in:\n{''.join(lines)}")


def refused(result: subprocess.CompletedProcess[str], status: int) -> str:
    """The one message of a command that could not do what it was asked to."""
    assert result.returncode == status, result.stderr
    assert result.stdout == ""
    assert "Traceback" not in result.stderr
    return result.stderr


def test_a_launch_leaves_the_front_as_json_and_as_a_picture(whole):
    folder, result = whole
    assert result.returncode == 0, result.stderr
    run = folder / "runs" / "small"
    assert {path.name for path in run.iterdir()} == {"run.sqlite", "run.lock", "front.json", "front.png"}
    front = json.loads((run / "front.json").read_text())["front"]
    listed = result.stdout.splitlines()
    assert listed[0].split() == ["nodes", "error", "formula"]
    assert any(front[-1]["expression"] in line and f"{front[-1]['error']:.4f}" in line for line in listed)
    assert any("[lambert, refitted]" in line for line in listed)
    assert listed[-1] == "front: runs/small/front.json   picture: runs/small/front.png"


def test_progress_is_plain_lines_where_there_is_no_terminal(whole):
    lines = whole[1].stderr.splitlines()
    assert lines[0] == "small starts on this process"
    assert lines[1].startswith("generation 1/4  ")
    assert lines[-3].startswith("generation 4/4  ")
    assert lines[-2].startswith("done (generations): 4 generations, 64 candidates, ")
    assert lines[-1].startswith("fits: ")
    assert " known from before, " in lines[-1]
    assert "\x1b" not in whole[1].stderr
    assert "\r" not in whole[1].stderr


def test_launching_a_finished_run_again_changes_nothing(whole):
    folder, _ = whole
    before = (folder / "runs/small/front.json").read_text()
    result = gpsearch("launch", "small.yaml", cwd=folder)
    assert result.returncode == 0
    assert result.stderr.startswith("small goes on after generation 4 on this process")
    assert (folder / "runs/small/front.json").read_text() == before


@pytest.mark.parametrize(
    "how",
    [
        pytest.param(signal.SIGINT, marks=pytest.mark.long),
        pytest.param(signal.SIGTERM, marks=pytest.mark.long),
        signal.SIGKILL,
    ],
)
def test_a_process_that_is_stopped_goes_on_to_the_same_front(folder, many_generations, how):
    text, uninterrupted = many_generations
    (folder / "small.yaml").write_text(text)
    with launched(folder) as process:
        wait_for(process.stderr, "generation 1/40")
        process.send_signal(how)
        status = {signal.SIGINT: 130, signal.SIGTERM: 143}.get(how, -how)
        assert process.wait(PATIENCE_SECONDS) == status
        assert process.stderr is not None
        told = process.stderr.read()
    if how != signal.SIGKILL:
        assert told.splitlines()[-2].startswith("stopped after generation ")
        assert told.splitlines()[-1] == "  gpsearch launch small.yaml --run run"
        assert "Traceback" not in told
    assert 1 <= Store.open(folder / "run").totals()[0] < 40
    assert holder(folder / "run") is None
    result = gpsearch("launch", "small.yaml", "--run", "run", cwd=folder)
    assert result.returncode == 0, result.stderr
    assert result.stderr.startswith("small goes on after generation ")
    assert without_times(folder / "run/front.json") == without_times(uninterrupted)
    events = [(kind, detail) for _, kind, detail in Store.open(folder / "run").events()]
    assert [kind for kind, _ in events] == [
        "launch",
        "takeover" if how == signal.SIGKILL else "stopped",
        "launch",
        "end",
    ]


@pytest.mark.long
def test_a_second_launcher_is_refused_while_the_first_one_runs(folder):
    (folder / "small.yaml").write_text(small_text(budget={"generations": 1000}))
    with launched(folder) as process:
        wait_for(process.stderr, "small starts")
        message = refused(gpsearch_process("launch", "small.yaml", "--run", "run", cwd=folder), 2)
        assert f"run: another gpsearch writes to this run (process {process.pid} on " in message
        running = json.loads(gpsearch("status", "run", "--json", cwd=folder).stdout)["running"]
        assert running == {"host": socket.gethostname(), "pid": process.pid}
        process.kill()
        process.wait()
    assert json.loads(gpsearch("status", "run", "--json", cwd=folder).stdout)["running"] is None


@pytest.mark.long
def test_a_full_disk_ends_the_run_and_loses_nothing(folder, whole):
    """A file system of half a megabyte; once there is room, the same command goes on."""
    small_disk = folder / "disk"
    small_disk.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=512k", "tmpfs", small_disk], capture_output=True, check=False
    )
    if mounted.returncode:
        pytest.skip("no right to mount a small file system")
    try:
        (folder / "small.yaml").write_text(small_text())
        filler = small_disk / "filler"
        filler.write_bytes(bytes(330_000))
        message = refused_after_start(gpsearch_process("launch", "small.yaml", "--run", "disk/run", cwd=folder), 1)
        assert "disk/run/run.sqlite: cannot be written (database or disk is full)" in message
        assert "make room or mend the disk, and the same command goes on from there" in message
        assert json.loads(gpsearch("status", "disk/run", "--json", cwd=folder).stdout)["generations"] < 4
        filler.unlink()
        subprocess.run(["mount", "-o", "remount,size=8m", small_disk], check=True)
        result = gpsearch("launch", "small.yaml", "--run", "disk/run", cwd=folder)
        assert result.returncode == 0, result.stderr
        assert without_times(small_disk / "run/front.json") == without_times(whole[0] / "runs/small/front.json")
    finally:
        subprocess.run(["umount", "-l", small_disk], check=True)


def test_ctrl_c_before_the_first_generation_is_as_clean(folder):
    """The command to go on with can be pasted, whatever is in the path."""
    # A first generation of some minutes.
    (folder / "small.yaml").write_text(small_text(search={"island_size": 20_000}))
    with launched(folder, run="my [bold]run :smile:") as process:
        wait_for(process.stderr, "small starts")
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE_SECONDS) == 130
        assert process.stderr is not None
        told = process.stderr.read()
    assert told.splitlines()[-2:] == [
        "stopped after generation 0; nothing is lost. To go on:",
        "  gpsearch launch small.yaml --run 'my [bold]run :smile:'",
    ]
    assert "Traceback" not in told


def test_check_prints_the_plan_and_runs_nothing(folder):
    result = gpsearch("launch", "small.yaml", "--check", cwd=folder)
    assert result.returncode == 0, result.stderr
    plan = result.stdout + result.stderr
    for words in (
        "small: the configuration is valid",
        "materials   metal (3 targets)",
        "light table in closed form",
        "2 islands of 8, 16 candidates a generation",
        "executor    this process",
        "4 generations",
        "candidates/s",
    ):
        assert words in plan
    assert [path.name for path in folder.iterdir()] == ["small.yaml"]


def test_a_wrong_path_is_named(folder):
    message = refused(gpsearch("launch", "smal.yaml", cwd=folder), 2)
    assert message == "gpsearch: smal.yaml: no such file; did you mean small.yaml?\n"


def test_a_misspelt_key_is_named_with_its_line(folder):
    (folder / "small.yaml").write_text(small_text() + "metrik: light\n")
    message = refused(gpsearch("launch", "small.yaml", cwd=folder), 2)
    assert "metrik: no such key; did you mean metric?" in message
    assert not (folder / "runs").exists()


def test_a_truncated_material_is_refused_and_the_run_goes_on_once_it_is_whole(folder):
    (folder / "steel.binary").write_bytes(HEADER + bytes(1000))
    (folder / "small.yaml").write_text(small_text(materials=["steel.binary"]))
    message = refused_after_start(gpsearch("launch", "small.yaml", cwd=folder), 2)
    assert f"steel.binary holds 1,012 bytes, a MERL file has {FILE_BYTES:,}: the download was cut short" in message
    metal = load_material("builtin:metal")
    write_merl(folder / "steel.binary", metal.table, metal.valid)
    result = gpsearch("launch", "small.yaml", cwd=folder)
    assert result.returncode == 0, result.stderr


def test_a_baseline_that_cannot_be_fitted_is_reported_and_the_run_ends_well(folder):
    metal = load_material("builtin:metal")
    dark = metal.valid.copy()
    dark[:, 0] = False  # nothing is known of its backscattering
    write_merl(folder / "dark.binary", metal.table, dark)
    materials, baselines = ["builtin:metal", "dark.binary"], ["power-iterations", "bivariate"]
    text = small_text(materials=materials, baselines=baselines, budget={"generations": 1})
    (folder / "small.yaml").write_text(text)
    result = gpsearch("launch", "small.yaml", "--run", "run", cwd=folder)
    assert result.returncode == 0, result.stderr
    exported = json.loads((folder / "run/front.json").read_text())
    jsonschema.validate(exported, schema(), jsonschema.Draft202012Validator)
    failed, fitted = exported["baselines"]
    reason = "dark: no cell with theta_diff below 1 degree is valid"
    assert failed["warnings"][0].startswith(reason)
    assert (failed["error"], failed["errors"]["dark"]) == (None, [None] * 3)
    assert all(error > 0 for error in failed["errors"]["metal"])
    listed = result.stdout.splitlines()[-3:-1]
    assert listed[0] == f"    -  {fitted['error']:7.4f}  [bivariate, 24,300 floats a material]"
    assert listed[1].startswith(f"    -        -  [power-iterations, not fitted: {reason}")


def test_a_configuration_may_change_as_long_as_nothing_was_found(folder):
    (folder / "steel.binary").write_bytes(HEADER + bytes(1000))
    (folder / "small.yaml").write_text(small_text(materials=["steel.binary"]))
    refused_after_start(gpsearch("launch", "small.yaml", "--run", "run", cwd=folder), 2)
    (folder / "small.yaml").write_text(small_text(budget={"generations": 1}))
    result = gpsearch("launch", "small.yaml", "--run", "run", cwd=folder)
    assert result.returncode == 0, result.stderr
    assert json.loads((folder / "run/front.json").read_text())["run"]["materials"] == ["metal"]


def refused_after_start(result: subprocess.CompletedProcess[str], status: int) -> str:
    """As `refused`; a line about the start comes before the message."""
    lines = refused(result, status).splitlines()
    assert [line for line in lines if line.startswith("gpsearch: ")] == lines[-1:]
    return lines[-1]


def test_a_scheduler_that_is_not_there_fails_the_run_and_loses_nothing(folder, whole):
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{unused.getsockname()[1]}"
        text = small_text(executor={"kind": "dask", "scheduler": address, "wait_seconds": 0.5})
        (folder / "small.yaml").write_text(text)
        message = refused(gpsearch_process("launch", "small.yaml", "--run", "run", cwd=folder), 1)
    assert address in message
    (folder / "small.yaml").write_text(small_text())
    result = gpsearch("launch", "small.yaml", "--run", "run", cwd=folder)
    assert result.returncode == 0, result.stderr
    assert without_times(folder / "run/front.json") == without_times(whole[0] / "runs/small/front.json")


def test_a_changed_configuration_is_refused_by_naming_its_keys(whole):
    folder, _ = whole
    (folder / "changed.yaml").write_text(small_text(seed=6, search={"max_nodes": 41}, budget={"generations": 3}))
    message = refused(gpsearch("launch", "changed.yaml", "--run", "runs/small", cwd=folder), 2)
    assert "runs/small holds a run with another configuration:" in message
    assert "  seed: 6 instead of 5" in message
    assert "  search.max_nodes: 41 instead of 40" in message
    assert "  budget.generations: 3 instead of 4" in message
    assert Store.open(folder / "runs/small").totals()[0] == 4


def test_a_larger_budget_extends_a_run(folder):
    (folder / "small.yaml").write_text(small_text(budget={"generations": 1}))
    assert gpsearch("launch", "small.yaml", cwd=folder).returncode == 0
    (folder / "small.yaml").write_text(small_text(budget={"generations": 2}))
    result = gpsearch("launch", "small.yaml", cwd=folder)
    assert result.returncode == 0, result.stderr
    assert result.stderr.startswith("small goes on after generation 1 on this process")
    assert Store.open(folder / "runs/small").totals()[0] == 2


@pytest.mark.parametrize("content", [b"", b"text, not a database"])
def test_a_damaged_run_is_refused(folder, content):
    (folder / "run").mkdir()
    (folder / "run" / "run.sqlite").write_bytes(content)
    message = refused(gpsearch("launch", "small.yaml", "--run", "run", cwd=folder), 2)
    assert "run/run.sqlite: not a readable run" in message


@pytest.mark.parametrize("change", ["UPDATE meta SET value = 'another'", "DELETE FROM meta"])
def test_a_run_under_another_light_table_does_not_go_on(whole, tmp_path, change):
    """The light file has changed, or an earlier version made the table and did not say which."""
    shutil.copytree(whole[0], tmp_path, dirs_exist_ok=True)
    with sqlite3.connect(tmp_path / "runs/small/run.sqlite") as store:
        store.execute(f"{change} WHERE key = 'light_sha256'")
    message = refused(gpsearch_process("launch", "small.yaml", cwd=tmp_path), 2)
    assert "runs/small: this run was searched under another light table" in message
    assert "another --run" in message


def test_a_light_table_that_has_not_converged_is_a_warning(tmp_path, monkeypatch):
    """Of a scene file whose table may take few samples only."""
    pytest.importorskip("mitsuba")
    monkeypatch.setattr(geometries, "POINTS", 16)
    monkeypatch.setattr(sampled, "ROUNDS", 1)
    monkeypatch.setenv("GPSEARCH_CACHE", str(tmp_path / "cache"))
    (tmp_path / "ball.xml").write_text(BALL)
    scene = {"light": "studio", "geometry": "ball.xml", "shadows": False}
    budget = {"generations": 1, "minutes": None}
    text = small_text(scene=scene, budget=budget, baselines=[], culling=0.0)
    (tmp_path / "small.yaml").write_text(text)
    checked = gpsearch("launch", "small.yaml", "--check", cwd=tmp_path)
    assert re.search(r"light table sampled, \d+\.\d % from its limit", checked.stdout)
    assert "warning: the light table is sampled" in checked.stderr
    ran = gpsearch("launch", "small.yaml", cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert "warning: the light table is sampled" in ran.stderr
    exported = json.loads((tmp_path / "runs/small/front.json").read_text())
    jsonschema.validate(exported, schema())
    assert exported["run"]["light_distance"] > 0.05
