"""A folder to write configurations into."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from gpsearch.configuration import Configuration, load_configuration
from gpsearch.errors import GpsearchError

MINIMAL = "materials: [builtin:metal]\n"


@pytest.fixture
def load(tmp_path: Path) -> Callable[..., Configuration]:
    """Loads a text, as the file quick.yaml of `tmp_path`; a material is named where `materials` is left out."""

    def load(text: str | bytes, name: str = "quick.yaml") -> Configuration:
        if isinstance(text, str):
            text = (text if re.search(r"^\W*materials:", text, re.MULTILINE) else text + "\n" + MINIMAL).encode()
        (tmp_path / name).write_bytes(text)
        return load_configuration(tmp_path / name)

    return load


@pytest.fixture
def pem_files(tmp_path: Path) -> None:
    """The files ca.pem, cert.pem and key.pem beside the configuration; a configuration reads no further."""
    for name, content in (("ca", "CERTIFICATE"), ("cert", "CERTIFICATE"), ("key", "EC PRIVATE KEY")):
        (tmp_path / f"{name}.pem").write_text(f"-----BEGIN {content}-----\n-----END {content}-----\n")


@pytest.fixture
def refusal(load: Callable[..., Configuration], tmp_path: Path) -> Callable[..., str]:
    """The message by which a text is refused, without the folder of the file."""

    def refusal(text: str | bytes) -> str:
        with pytest.raises(GpsearchError) as caught:
            load(text)
        assert caught.value.__cause__ is None
        return str(caught.value).replace(f"{tmp_path}/", "")

    return refusal
