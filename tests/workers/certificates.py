"""Certificate authorities and certificates, made for a test."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

import trustme

from workers import Tls


def write_tls(folder: Path, authority: trustme.CA, *, expired: bool = False) -> Tls:
    """The files of a new certificate of `authority`, in a folder that is made for them."""
    folder.mkdir()
    ends = datetime.now(UTC) + timedelta(days=-1 if expired else 1)
    issued = authority.issue_cert("gpsearch", not_after=ends)
    files = Tls(folder / "ca.pem", folder / "cert.pem", folder / "key.pem")
    authority.cert_pem.write_to_path(str(files.ca))
    issued.cert_chain_pems[0].write_to_path(str(files.cert))
    issued.private_key_pem.write_to_path(str(files.key))
    return files
