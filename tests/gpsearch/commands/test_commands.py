"""The other commands: what they say on standard output, what on standard error, and how they end."""

import json
import subprocess
from pathlib import Path

import jsonschema
import pytest

from gpsearch.exports import schema
from gpsearch.run import Generation, Quarantined, Store
from tests.gpsearch.small import (
    GPSEARCH,
    Watching,
    gpsearch,
    make_store,
    run_search,
    small,
    small_text,
    without_times,
    writing,
)

COOK = "p0 / pi + p1 * pow(wh.z, p2)"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a finished run, `run`, and one stopped after two generations, `stopped`."""
    folder = tmp_path_factory.mktemp("commands")
    (folder / "small.yaml").write_text(small_text(budget={"generations": 2}))

    def stop(event: str) -> None:
        if event == "describing the front":
            raise KeyboardInterrupt

    configuration = small(folder, budget={"generations": 2})
    run_search(folder / "run", configuration).close()
    with pytest.raises(KeyboardInterrupt):
        run_search(folder / "stopped", configuration, Watching(stop))
    return folder


def object_on_stdout(result: subprocess.CompletedProcess[str]) -> dict:
    assert result.returncode == 0, result.stderr
    found = json.loads(result.stdout)
    assert isinstance(found, dict)
    return found


def test_export_writes_the_front_to_standard_output_or_a_file(folder):
    result = gpsearch("export", "run", cwd=folder)
    exported = object_on_stdout(result)
    jsonschema.validate(exported, schema(), jsonschema.Draft202012Validator)
    assert len(exported["front"]) == len(Store.open(folder / "run").front().members)
    to_file = gpsearch("export", "run", "--format", "json", "-o", "out.json", cwd=folder)
    assert (to_file.returncode, to_file.stdout) == (0, "")
    assert (folder / "out.json").read_text() == result.stdout


def test_export_describes_a_run_that_was_stopped(folder):
    stopped, whole = (gpsearch("export", name, cwd=folder) for name in ("stopped", "run"))
    assert without_times(object_on_stdout(stopped)) == without_times(object_on_stdout(whole))


@pytest.mark.parametrize("command", ["export", "status"])
def test_no_run_is_exit_status_2(folder, command):
    result = gpsearch(command, "nowhere", cwd=folder)
    assert (result.returncode, result.stdout) == (2, "")
    assert result.stderr == "gpsearch: nowhere: no run here (run.sqlite is missing); `gpsearch launch` makes one\n"


def test_an_export_that_cannot_be_written_is_exit_status_2(folder):
    result = gpsearch("export", "run", "-o", "missing/out.json", cwd=folder)
    assert (result.returncode, result.stdout) == (2, "")
    assert "missing/out.json: cannot be written (No such file or directory)" in result.stderr


def test_status_says_where_a_run_stands(folder):
    result = gpsearch("status", "run", cwd=folder)
    assert result.returncode == 0
    lines = result.stdout.splitlines()
    assert lines[0] == "small: not running"
    assert lines[1].startswith("generation 2 of 2, 32 candidates, ")
    assert lines[1].endswith(" a second, 0 s left")
    assert lines[2] == "generations of islands: 0: 2  1: 2"
    assert lines[3].startswith("fits: ")
    assert lines[4].startswith("front: ")
    assert lines[5] == "0 retries, 0 workers lost, 0 quarantined"
    found = object_on_stdout(gpsearch("status", "run", "--json", cwd=folder))
    assert (found["name"], found["running"]) == ("small", None)
    assert (found["generations"], found["of_generations"], found["candidates"]) == (2, 2, 32)
    assert found["islands"] == [{"island": 0, "generation": 2}, {"island": 1, "generation": 2}]
    # The seconds are rounded to a tenth.
    assert 32 / found["candidates_per_second"] == pytest.approx(found["seconds"], abs=0.06)
    assert found["seconds_left"] == 0
    member = Store.open(folder / "run").front().members[-1]
    assert found["best"] == {"nodes": member.nodes, "error": member.error}


def test_status_tells_what_went_wrong_on_the_cluster(folder):
    hard = make_store(folder / "hard", small(folder, budget={"candidates": 64}).text())
    with writing(hard) as store, store.transaction():
        store.save_generation(Generation(0, 1, 16, 16, 0, 1, 0.5, 2.0, {}))
        store.save_seconds(10.0)
        store.save_quarantined([Quarantined("p0 / wh.z", "screen", "did not end within 60 s, 2 times", 1, 3)])
        store.log("workers", "2 joined, 2 there")
        store.log("lost", "tcp://10.0.0.7:4321")
        for count in ("3", "4"):
            store.log("retry", count)
    shown = gpsearch("status", "hard", cwd=folder).stdout
    assert "30 s left" in shown
    assert "workers: 2 joined, 2 there" in shown
    assert "7 retries, 1 workers lost, 1 quarantined" in shown
    assert "  screen: p0 / wh.z: did not end within 60 s, 2 times" in shown
    assert "lost: tcp://10.0.0.7:4321" in shown
    found = object_on_stdout(gpsearch("status", "hard", "--json", cwd=folder))
    assert (found["retries"], found["lost_workers"], found["seconds_left"]) == (7, 1, 30.0)
    assert found["quarantined"] == [
        {
            "expression": "p0 / wh.z",
            "stage": "screen",
            "reason": "did not end within 60 s, 2 times",
            "island": 1,
            "generation": 3,
        }
    ]
    assert [event["kind"] for event in found["events"]] == ["workers", "lost"]


def test_status_of_a_run_that_has_done_nothing_yet(folder):
    make_store(folder / "empty", small(folder).text())
    assert object_on_stdout(gpsearch("status", "empty", "--json", cwd=folder))["best"] is None
    assert gpsearch("status", "empty", cwd=folder).returncode == 0


def test_materials_lists_and_describes(folder):
    names = object_on_stdout(gpsearch("materials", "--json", cwd=folder))["builtin"]
    assert "builtin:metal" in names
    found = object_on_stdout(gpsearch("materials", "--json", "builtin:metal", cwd=folder))
    assert [material["name"] for material in found["materials"]] == ["metal"]


def test_fit_reports_one_object(folder):
    found = object_on_stdout(gpsearch("fit", COOK, "builtin:metal", "--json", cwd=folder))
    assert found["expression"] == COOK
    assert set(found["parameters"]) == {"p0", "p1", "p2"}
    assert found["error"] == pytest.approx(found["metrics"]["light"])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("fit", "gxg", "builtin:metal"), "ggx"),
        (("fit", "p0 +", "builtin:metal"), "p0 +"),
        (("fit", "ggx", "builtin:metl"), "builtin:metal"),
        (("fit", "ggx", "missing.binary"), "missing.binary"),
        (("materials", "missing.binary"), "missing.binary"),
        (("lunch", "small.yaml"), "lunch"),
        (("launch",), "CONFIG"),
        (("launch", "small.yaml", "--fast"), "--fast"),
    ],
)
def test_bad_input_is_one_message_and_exit_status_2(folder, arguments, words):
    result = gpsearch(*arguments, cwd=folder)
    assert (result.returncode, result.stdout) == (2, "")
    assert words in result.stderr
    assert "Traceback" not in result.stderr


def test_output_that_nobody_reads_is_no_traceback(folder):
    command = f"{GPSEARCH} export run | head -c 10"
    result = subprocess.run(["bash", "-c", command], cwd=folder, capture_output=True, text=True, check=False)
    assert "Traceback" not in result.stderr


def test_help_and_version():
    for arguments in (("--help",), ("-h",), ("--version",), ("launch", "--help")):
        result = gpsearch(*arguments, cwd=Path.cwd())
        assert result.returncode == 0
        assert result.stdout
