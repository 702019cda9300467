"""`gpsearch launch` on a cluster that speaks nothing but TLS."""

from pathlib import Path

import pytest
import trustme

from tests.gpsearch.small import gpsearch, small_text
from tests.workers.certificates import write_tls
from tests.workers.cluster import real_cluster

FILES = {"ca": "tls/ca.pem", "cert": "tls/cert.pem", "key": "tls/key.pem"}


@pytest.mark.long
def test_a_run_goes_on_over_tls(tmp_path: Path) -> None:
    """The paths of the files count from the configuration's folder, not from where the command is given."""
    folder = tmp_path / "mine"
    folder.mkdir()
    tls = write_tls(folder / "tls", trustme.CA())

    def launch(generations: int, executor: object) -> str:
        text = small_text(budget={"generations": generations}, executor=executor)
        (folder / "small.yaml").write_text(text)
        result = gpsearch("launch", "mine/small.yaml", "--run", "run", cwd=tmp_path)
        assert result.returncode == 0, result.stderr
        return result.stderr.splitlines()[0]

    assert launch(1, "local") == "small starts on this process"
    with real_cluster(workers=1, tls=tls) as address:
        executor = {"kind": "dask", "scheduler": address, "wait_seconds": 20, "tls": FILES}
        assert launch(2, executor) == f"small goes on after generation 1 on {address} with 1 worker"
