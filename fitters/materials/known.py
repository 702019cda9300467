"""The 100 released MERL files, recognised by their content: `merl_sha256.txt` holds hash, size and name."""

from functools import cache
from importlib import resources


@cache
def _genuine() -> dict[str, str]:
    listing = resources.files("fitters.materials").joinpath("merl_sha256.txt").read_text("utf-8")
    lines = [line.split() for line in listing.splitlines() if line.strip()]
    return {sha256: name for sha256, _, name in lines}


def genuine_merl_name(sha256: str) -> str | None:
    """The released MERL file with this content, such as `chrome.binary`; None where it is none of the 100."""
    return _genuine().get(sha256)
