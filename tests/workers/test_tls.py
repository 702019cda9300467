"""TLS with a real scheduler and real workers, and what is said where it fails."""

from __future__ import annotations

import shutil
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
import trustme
from cryptography.hazmat.primitives import serialization

from tests.unprivileged import public_folder, unprivileged
from tests.workers import work
from tests.workers.certificates import write_tls
from tests.workers.cluster import ROOT, real_cluster
from workers import DaskSettings, Job, Tls, WorkersError, open_executor

NOWHERE = "tls://127.0.0.1:1"
SECRET = "no-one-else-shall-read-this"


@pytest.fixture(scope="module")
def authority() -> trustme.CA:
    return trustme.CA()


@pytest.fixture(scope="module")
def tls(tmp_path_factory: pytest.TempPathFactory, authority: trustme.CA) -> Tls:
    return write_tls(tmp_path_factory.mktemp("tls") / "launcher", authority)


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory, authority: trustme.CA) -> Iterator[str]:
    """The address of a scheduler with one worker, by another certificate than the launcher's."""
    with real_cluster(workers=1, tls=write_tls(tmp_path_factory.mktemp("tls") / "cluster", authority)) as address:
        yield address


def failure(settings: DaskSettings) -> str:
    with pytest.raises(WorkersError) as caught, open_executor(settings):
        pass
    return str(caught.value)


def test_tasks_run_over_tls(cluster: str, tls: Tls) -> None:
    assert cluster.startswith("tls://")
    with open_executor(DaskSettings(cluster, wait_seconds=20, tls=tls)) as executor:
        assert executor.description == f"{cluster} with 1 worker"
        found = work.results_of(executor, Job(work.combine, work.RECIPE, range(5), "fit"))
    assert found == {n: ("context of tests", n**2) for n in range(5)}


def test_nothing_is_in_clear_on_the_wire(cluster: str, tls: Tls) -> None:
    """The same task, past an eavesdropper, who reads it where there is no TLS."""

    def overheard(address: str, tls: Tls | None) -> bytes:
        with eavesdropper(address) as (detour, heard):
            with open_executor(DaskSettings(detour, wait_seconds=20, tls=tls)) as executor:
                job = Job(work.environment, work.RECIPE, [SECRET], "fit")
                assert work.results_of(executor, job) == {0: None}
            return bytes(heard)

    assert SECRET.encode() not in overheard(cluster, tls)
    with real_cluster(workers=1) as plain:
        assert SECRET.encode() in overheard(plain, None)


@contextmanager
def eavesdropper(address: str) -> Iterator[tuple[str, bytearray]]:
    """An address that leads to `address`, and every byte that passes through it."""
    scheme, _, place = address.partition("://")
    host, port = place.split(":")
    heard = bytearray()

    def pass_on(source: socket.socket, sink: socket.socket) -> None:
        try:
            while data := source.recv(65536):
                heard.extend(data)
                sink.sendall(data)
        except OSError:
            pass
        for end in (source, sink):
            end.close()

    def accept() -> None:
        while True:
            try:
                near, _ = server.accept()
            except OSError:
                return
            far = socket.create_connection((host, int(port)))
            for pair in ((near, far), (far, near)):
                threading.Thread(target=pass_on, args=pair, daemon=True).start()

    with socket.create_server(("127.0.0.1", 0)) as server:
        threading.Thread(target=accept, daemon=True).start()
        yield f"{scheme}://127.0.0.1:{server.getsockname()[1]}", heard
        server.shutdown(socket.SHUT_RDWR)


def test_a_plain_client_is_refused(cluster: str) -> None:
    plain = cluster.replace("tls://", "tcp://")
    assert failure(DaskSettings(plain, wait_seconds=20)) == (
        f"the Dask scheduler at {plain} expects TLS: write tls:// and name the files ca, cert and key under tls"
    )


def test_a_plain_scheduler_is_refused(tls: Tls) -> None:
    with real_cluster(workers=0) as plain:
        address = plain.replace("tcp://", "tls://")
        message = failure(DaskSettings(address, wait_seconds=20, tls=tls))
    assert message == (
        f"what answers at {address} does not speak TLS: start the scheduler with `dask-scheduler --tls-ca-file CA "
        "--tls-cert CERT --tls-key KEY`, or write tcp:// and leave out tls"
    )


def test_a_scheduler_of_another_authority_is_refused(cluster: str, tls: Tls, tmp_path: Path) -> None:
    wrong = replace(tls, ca=write_tls(tmp_path / "other", trustme.CA()).ca)
    message = failure(DaskSettings(cluster, wait_seconds=20, tls=wrong))
    assert message.startswith(f"the certificate of the Dask scheduler at {cluster} is not of the authority in")
    assert message.endswith("name the CA file that the scheduler was started with")


def test_a_certificate_of_another_authority_is_refused(cluster: str, tls: Tls, tmp_path: Path) -> None:
    wrong = replace(write_tls(tmp_path / "other", trustme.CA()), ca=tls.ca)
    assert failure(DaskSettings(cluster, wait_seconds=20, tls=wrong)) == (
        f"the Dask scheduler at {cluster} refuses the certificate {wrong.cert} (unknown ca): "
        "name one of the authority that the scheduler was started with"
    )


def test_our_expired_certificate(cluster: str, authority: trustme.CA, tmp_path: Path) -> None:
    expired = write_tls(tmp_path / "expired", authority, expired=True)
    assert failure(DaskSettings(cluster, wait_seconds=20, tls=expired)) == (
        f"the Dask scheduler at {cluster} refuses the certificate {expired.cert}: it has expired, renew it"
    )


def test_the_schedulers_expired_certificate(authority: trustme.CA, tls: Tls, tmp_path: Path) -> None:
    with real_cluster(workers=0, tls=write_tls(tmp_path / "expired", authority, expired=True)) as address:
        message = failure(DaskSettings(address, wait_seconds=20, tls=tls))
    assert message == (
        f"the certificate of the Dask scheduler at {address}, or that of its authority, has expired: "
        "renew it and start the scheduler again"
    )


def test_a_scheduler_without_workers_says_how_to_start_them(tls: Tls) -> None:
    with real_cluster(workers=0, tls=tls) as address:
        message = failure(DaskSettings(address, wait_seconds=2, tls=tls))
    assert message.endswith(f"with `dask-worker {address} --tls-ca-file CA --tls-cert CERT --tls-key KEY`")


def test_no_scheduler(tls: Tls) -> None:
    message = failure(DaskSettings(NOWHERE, wait_seconds=0.5, tls=tls))
    assert "start one with `dask-scheduler --tls-ca-file CA --tls-cert CERT --tls-key KEY`" in message


def test_a_server_that_says_nothing(tls: Tls) -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"tls://127.0.0.1:{silent.getsockname()[1]}"
        message = failure(DaskSettings(address, wait_seconds=1, tls=tls))
    assert f"no Dask scheduler answers at {address} after 1 s" in message


@pytest.mark.parametrize("name", ["ca", "cert", "key"])
def test_a_file_that_is_missing_or_no_pem(tls: Tls, tmp_path: Path, name: str) -> None:
    path = tmp_path / "file"
    settings = DaskSettings(NOWHERE, tls=replace(tls, **{name: path}))
    assert failure(settings) == f"tls.{name}: {path} cannot be read (No such file or directory): check it"
    path.write_text("steel")
    kind = "private key" if name == "key" else "certificate"
    assert failure(settings) == f"tls.{name}: {path} holds no PEM {kind}: name one that does"
    path.unlink()
    path.mkdir()
    assert failure(settings) == f"tls.{name}: {path} cannot be read (Is a directory): check it"


def test_a_key_that_we_may_not_read(authority: trustme.CA) -> None:
    with public_folder() as folder:
        tls = write_tls(folder / "tls", authority)
        tls.key.chmod(0)
        with unprivileged():
            message = failure(DaskSettings(NOWHERE, tls=tls))
    assert message == f"tls.key: {tls.key} cannot be read (Permission denied): check it"


def test_a_key_of_another_certificate(tls: Tls, authority: trustme.CA, tmp_path: Path) -> None:
    other = write_tls(tmp_path / "other", authority)
    message = failure(DaskSettings(NOWHERE, tls=replace(tls, key=other.key)))
    assert message.startswith(f"tls.key: {other.key} is not the key of the certificate {tls.cert}")


@pytest.mark.skipif(shutil.which("openssl") is None, reason="nothing else here makes a key so short")
def test_a_certificate_that_is_too_weak(tls: Tls, tmp_path: Path) -> None:
    weak = Tls(tls.ca, tmp_path / "cert.pem", tmp_path / "key.pem")
    command = "openssl req -x509 -newkey rsa:512 -nodes -subj /CN=weak -out cert.pem -keyout key.pem"
    subprocess.run(command.split(), cwd=tmp_path, check=True, capture_output=True)
    message = failure(DaskSettings(NOWHERE, tls=weak))
    assert message.startswith(f"tls.cert: OpenSSL refuses {weak.cert} as too weak (EE_KEY_TOO_SMALL)")


def test_a_passphrase_is_not_asked_for(tls: Tls, tmp_path: Path) -> None:
    """In a process of its own, which has no terminal: OpenSSL would wait for the passphrase at ours."""
    key = serialization.load_pem_private_key(tls.key.read_bytes(), None)
    locked = tmp_path / "locked.pem"
    secret = serialization.BestAvailableEncryption(b"secret")
    pem, form = serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8
    locked.write_bytes(key.private_bytes(pem, form, secret))
    script = f"""
from pathlib import PosixPath
from workers import DaskSettings, Tls, open_executor
open_executor(DaskSettings({NOWHERE!r}, tls={replace(tls, key=locked)})).__enter__()
"""
    command = [sys.executable, "-c", script]
    result = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, timeout=60, start_new_session=True, check=False
    )
    assert f"WorkersError: tls.key: {locked} has a passphrase: name one without" in result.stderr


def test_tls_and_the_address_go_together(tls: Tls) -> None:
    with pytest.raises(WorkersError, match="tls is for a scheduler at tls://HOST:PORT"):
        DaskSettings("tcp://127.0.0.1:8786", tls=tls)
    with pytest.raises(WorkersError, match="tls is for a scheduler at tls://HOST:PORT"):
        DaskSettings(workers=2, tls=tls)
    with pytest.raises(WorkersError, match="needs the files ca, cert and key"):
        DaskSettings(NOWHERE)
