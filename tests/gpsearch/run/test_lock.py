"""One launcher a run directory, with real processes."""

import errno
import fcntl
import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from gpsearch import __version__
from gpsearch.errors import GpsearchError
from gpsearch.run.lock import FILE, Holder, RunLock
from tests.unprivileged import public_folder, unprivileged

ROOT = Path(__file__).parents[3]

HOLD = """
print(0, flush=True)
input()
"""
WITH_A_COMMAND = """
import subprocess
print(subprocess.Popen(["sleep", "60"], close_fds=False).pid, flush=True)
input()
"""
WITH_A_WORKER = """
from tests.workers import work
from workers import DaskSettings, Job, open_executor
with open_executor(DaskSettings(workers=1)) as executor:
    worker, _ = work.results_of(executor, Job(work.process_and_builds, work.RECIPE, [0], "who"))[0]
    print(worker, flush=True)
    input()
"""


@contextmanager
def launcher(folder: Path, then: str = HOLD) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """A process that holds the lock of a folder, and the process that it started, if any."""
    body = "".join(f"    {line}\n" for line in then.splitlines())
    script = "from pathlib import Path\nfrom gpsearch.run.lock import RunLock\n\nif __name__ == '__main__':\n"
    script += f"    lock = RunLock(Path({str(folder)!r}))\n{body}    lock.release()\n"
    path = folder.parent / "launcher.py"
    path.write_text(script)
    with subprocess.Popen(
        [sys.executable, path],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        try:
            yield process, int(process.stdout.readline())
        finally:
            process.kill()


def refusal(folder: Path) -> str:
    with pytest.raises(GpsearchError) as caught:
        RunLock(folder)
    return str(caught.value)


def test_a_lock_says_who_holds_it(tmp_path):
    with RunLock(tmp_path / "runs" / "new") as lock:
        text = (tmp_path / "runs" / "new" / FILE).read_text()
        assert text.count("\n") == 1
        content = json.loads(text)
        assert (content["host"], content["pid"]) == (socket.gethostname(), os.getpid())
        assert content["version"] == __version__
        assert timedelta() <= datetime.now(UTC) - datetime.fromisoformat(content["started"]) < timedelta(hours=1)
        assert lock.taken_over_from is None
        assert refusal(tmp_path / "runs" / "new").startswith(f"{tmp_path}/runs/new: another gpsearch writes")


def test_a_second_launcher_is_refused_by_the_name_of_the_first(tmp_path):
    with launcher(tmp_path / "run") as (process, _):
        started = json.loads((tmp_path / "run" / FILE).read_text())["started"]
        for _ in range(2):
            assert refusal(tmp_path / "run") == (
                f"{tmp_path / 'run'}: another gpsearch writes to this run (process {process.pid} on "
                f"{socket.gethostname()} since {started}); wait for it or stop it, or name another directory "
                "with --run"
            )


def test_a_holder_that_has_not_said_who_it_is_is_respected_all_the_same(tmp_path):
    with RunLock(tmp_path):
        for content in ("", '{"host": "a', "[]", '{"pid": 1}', "9" * 5000):
            (tmp_path / FILE).write_text(content)
            assert "another gpsearch writes to this run; wait for it or stop it" in refusal(tmp_path)


def test_a_lock_that_was_released_is_taken_over_from_nobody(tmp_path):
    with launcher(tmp_path / "run") as (process, _):
        process.communicate("end\n")
        assert process.returncode == 0
    assert (tmp_path / "run" / FILE).read_text() == ""
    with RunLock(tmp_path / "run") as lock:
        assert lock.taken_over_from is None
        lock.release()
        with RunLock(tmp_path / "run") as again:
            assert again.taken_over_from is None
            lock.release()
            assert "another gpsearch" in refusal(tmp_path / "run")


@pytest.mark.parametrize("children", [HOLD, WITH_A_COMMAND, WITH_A_WORKER], ids=["alone", "command", "worker"])
def test_the_lock_of_a_killed_launcher_is_taken_over_while_its_child_lives_on(tmp_path, children):
    with launcher(tmp_path / "run", children) as (process, child):
        if child:
            # A worker would leave when its launcher does; stopped, it is there to the end.
            os.kill(child, signal.SIGSTOP)
        try:
            assert "another gpsearch" in refusal(tmp_path / "run")
            process.kill()
            process.wait()
            with RunLock(tmp_path / "run") as lock:
                assert lock.taken_over_from is not None
                assert lock.taken_over_from.pid == process.pid
                assert lock.taken_over_from.host == socket.gethostname()
            if child:
                os.kill(child, 0)
        finally:
            if child:
                os.kill(child, signal.SIGKILL)


def test_an_unreadable_file_of_a_dead_launcher_is_taken_over(tmp_path):
    for content in (b"\0" * 50, b"\xff", b'{"host": "a"', b"[" * 9000):
        (tmp_path / FILE).write_bytes(content)
        with RunLock(tmp_path) as lock:
            assert lock.taken_over_from is None
            assert json.loads((tmp_path / FILE).read_text())["pid"] == os.getpid()


def test_one_of_many_that_start_at_once_gets_it(tmp_path):
    """Each tells what became of it; the one that holds the lock keeps it until all have."""
    script = """
import sys
from pathlib import Path
from gpsearch.errors import GpsearchError
from gpsearch.run.lock import RunLock
try:
    lock = RunLock(Path(sys.argv[1]))
    print("held", flush=True)
except GpsearchError:
    print("refused", flush=True)
input()
"""
    command, options = [sys.executable, "-c", script, tmp_path], {"stdin": -1, "stdout": -1, "text": True}
    processes = [subprocess.Popen(command, cwd=ROOT, **options) for _ in range(4)]
    told = [process.stdout.readline().strip() for process in processes]
    for process in processes:
        process.communicate("\n")
    assert sorted(told) == ["held", "refused", "refused", "refused"]


@pytest.mark.parametrize("number", [errno.ENOLCK, errno.EOPNOTSUPP])
def test_a_file_system_without_locks(tmp_path, monkeypatch, number):
    def flock(descriptor, operation):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(fcntl, "flock", flock)
    message = refusal(tmp_path)
    assert message == (
        f"{tmp_path}: the run cannot be locked ({os.strerror(number)}); "
        "its file system has no locks, choose a directory on a local disk with --run"
    )


def test_a_folder_that_cannot_be_written():
    with public_folder() as folder, unprivileged():
        if os.geteuid() == folder.stat().st_uid:
            folder.chmod(0o555)
        message = refusal(folder)
        deeper = refusal(folder / "run")
    ending = "the run cannot be locked there (Permission denied); choose another --run"
    assert message == f"{folder / FILE}: {ending}"
    assert deeper == f"{folder / 'run' / FILE}: {ending}"


def test_what_is_no_folder(tmp_path):
    (tmp_path / "file").touch()
    assert "choose another --run" in refusal(tmp_path / "file")
    (tmp_path / FILE).mkdir()
    assert "(Is a directory); choose another --run" in refusal(tmp_path)


def test_a_link_is_not_followed(tmp_path):
    (tmp_path / "precious").write_text("data")
    (tmp_path / FILE).symlink_to("precious")
    assert "choose another --run" in refusal(tmp_path)
    assert (tmp_path / "precious").read_text() == "data"


def test_a_full_disk(tmp_path, monkeypatch):
    def pwrite(descriptor, content, offset):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "pwrite", pwrite)
    assert "cannot be written (No space left on device); make room there" in refusal(tmp_path)
    monkeypatch.undo()
    RunLock(tmp_path).release()


def test_a_holder_in_words():
    assert str(Holder("steel", 4711, "2026-01-02T03:04:05+00:00", "1.0")) == (
        "process 4711 on steel since 2026-01-02T03:04:05+00:00"
    )
