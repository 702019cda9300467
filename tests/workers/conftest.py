"""Every dispatcher here writes a log, checks its invariants after every event, and is replayed in the end."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from workers.dispatch.replay import FOLDER, replay


@pytest.fixture(scope="module", autouse=True)
def dispatch_logs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The folder of the logs of a test module."""
    folder = tmp_path_factory.mktemp("dispatch")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(FOLDER, str(folder))
        yield folder
    for path in folder.glob("*.jsonl"):
        with path.open() as file:
            assert [event for event, before, now in replay(file) if before != now] == [], path
