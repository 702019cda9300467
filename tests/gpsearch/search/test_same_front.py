"""One process, or worker processes of a real cluster: the front is the same to the last bit."""

import json

import jsonschema
import pytest

from gpsearch.configuration.model import DEFAULT_BASELINES
from gpsearch.exports import schema
from tests.gpsearch.small import gpsearch, gpsearch_process, small_text, without_times
from tests.workers.cluster import real_cluster


@pytest.mark.parametrize(
    "baselines",
    [["lambert", "bivariate"], pytest.param(list(DEFAULT_BASELINES), marks=pytest.mark.long)],
    ids=["two baselines", "the default baselines"],
)
def test_the_front_is_the_same_in_one_process_and_on_two_workers_of_a_scheduler(tmp_path, baselines):
    """The front, culled, and the baselines."""
    (tmp_path / "small.yaml").write_text(small_text(executor="local", baselines=baselines, culling=0.01))
    alone = gpsearch("launch", "small.yaml", "--run", "alone", cwd=tmp_path)
    assert alone.returncode == 0, alone.stderr
    with real_cluster(workers=2) as address:
        executor = {"kind": "dask", "scheduler": address}
        text = small_text(executor=executor, baselines=baselines, culling=0.01)
        (tmp_path / "small.yaml").write_text(text)
        spread = gpsearch_process("launch", "small.yaml", "--run", "spread", cwd=tmp_path)
    assert spread.returncode == 0, spread.stderr
    assert f"{address} with 2 workers" in spread.stderr
    fronts = [without_times(tmp_path / run / "front.json") for run in ("alone", "spread")]
    assert fronts[0] == fronts[1]
    exported = json.loads(fronts[0])
    jsonschema.validate(exported, schema(), jsonschema.Draft202012Validator)
    assert [b["name"] for b in exported["baselines"] if b["error"] is not None] == baselines
