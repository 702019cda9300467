"""TLS to a Dask scheduler: the files it takes, and what is wrong where it fails.

Both sides show a certificate, and each checks the other's against the cluster's own certificate authority. Host
names are not checked, as is Dask's way.
"""

from __future__ import annotations

import socket
import ssl
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

from workers.errors import WorkersError

PROBE_SECONDS = 5.0
"""The longest that a diagnosis takes."""
OPTIONS = "--tls-ca-file CA --tls-cert CERT --tls-key KEY"
"""What `dask-scheduler` and `dask-worker` take."""

_EXPIRED = 10
"""X509_V_ERR_CERT_HAS_EXPIRED"""
_NOT_TLS = ("WRONG_VERSION_NUMBER", "PACKET_LENGTH_TOO_LONG", "RECORD_LAYER_FAILURE", "HTTP_REQUEST")
"""How OpenSSL, by its version, calls an answer that is no TLS."""


@dataclass(frozen=True)
class Tls:
    """Absolute paths of PEM files: the cluster's certificate authority, our certificate and its private key."""

    ca: Path
    cert: Path
    key: Path


def check_files(tls: Tls) -> None:
    """Raises `WorkersError` for a file that cannot be read or is not what it should be.

    Dask would not say which file it is, and would ask at the terminal for the passphrase of a key.
    """
    for name, path in (("ca", tls.ca), ("cert", tls.cert), ("key", tls.key)):
        try:
            path.read_bytes()
        except OSError as error:
            raise WorkersError(f"tls.{name}: {path} cannot be read ({error.strerror}): check it") from error
    for name, path in (("ca", tls.ca), ("cert", tls.cert)):
        try:
            ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT).load_verify_locations(path)
        except ssl.SSLError as error:
            raise WorkersError(f"tls.{name}: {path} holds no PEM certificate: name one that does") from error
    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT).load_cert_chain(tls.cert, tls.key, _refuse_passphrase)
    except _Passphrase as error:
        raise WorkersError(
            f"tls.key: {tls.key} has a passphrase: name one without, as `openssl pkey -in KEY -out OPEN_KEY` makes"
        ) from error
    except ssl.SSLError as error:
        reason = error.reason or ""
        if reason == "KEY_VALUES_MISMATCH":
            text = f"tls.key: {tls.key} is not the key of the certificate {tls.cert}: name that one"
        elif reason.endswith(("TOO_SMALL", "TOO_WEAK")):
            text = f"tls.cert: OpenSSL refuses {tls.cert} as too weak ({reason}): make one with a longer key"
        else:
            text = f"tls.key: {tls.key} holds no PEM private key: name one that does"
        raise WorkersError(text) from error


class _Passphrase(Exception):
    """A key asks for one."""


def _refuse_passphrase() -> str:
    raise _Passphrase


def trouble(address: str, tls: Tls, context: ssl.SSLContext, seconds: float) -> str | None:
    """Why the scheduler at `address` and we cannot agree on TLS; None where they can, or nothing answers."""
    try:
        with _open(address, seconds) as plain, context.wrap_socket(plain) as encrypted:
            # A scheduler looks at our certificate after we are done with its own, and is the first to speak.
            encrypted.recv(1)
    except ssl.SSLEOFError:
        return None
    except ssl.SSLCertVerificationError as error:
        if error.verify_code == _EXPIRED:
            return (
                f"the certificate of the Dask scheduler at {address}, or that of its authority, has expired: "
                "renew it and start the scheduler again"
            )
        return (
            f"the certificate of the Dask scheduler at {address} is not of the authority in {tls.ca} "
            f"({error.verify_message}): name the CA file that the scheduler was started with"
        )
    except ssl.SSLError as error:
        return _refusal(address, tls, error.reason or str(error))
    except OSError:
        return None
    return None


def _refusal(address: str, tls: Tls, reason: str) -> str:
    if reason in _NOT_TLS:
        return (
            f"what answers at {address} does not speak TLS: start the scheduler with `dask-scheduler {OPTIONS}`, "
            "or write tcp:// and leave out tls"
        )
    _, is_alert, alert = reason.partition("ALERT_")
    if not is_alert:
        return f"no TLS with the Dask scheduler at {address} ({reason}): compare its version of OpenSSL with ours"
    if "EXPIRED" in alert:
        return f"the Dask scheduler at {address} refuses the certificate {tls.cert}: it has expired, renew it"
    return (
        f"the Dask scheduler at {address} refuses the certificate {tls.cert} "
        f"({alert.replace('_', ' ').lower()}): name one of the authority that the scheduler was started with"
    )


def expects_tls(address: str, seconds: float) -> bool:
    """Whether what listens at `address` speaks TLS."""
    context = ssl.create_default_context()
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    try:
        with _open(address, seconds) as plain, context.wrap_socket(plain):
            return True
    except ssl.SSLError as error:
        return "ALERT_" in (error.reason or "")
    except OSError:
        return False


def _open(address: str, seconds: float) -> socket.socket:
    place = urlsplit(address)
    return socket.create_connection((place.hostname, place.port), timeout=max(0.1, min(PROBE_SECONDS, seconds)))
