"""Warnings of formulas travel: from the fit to the store, and from there into front.json."""

import json
import math

import jsonschema
import numpy as np
import pytest

from fitters.fitting import Description, Fit
from fitters.judging.checks import Checks
from gpsearch.exports import schema
from gpsearch.genomes import Genome
from gpsearch.run import FormulaBaseline, Member, load_run
from gpsearch.run.records import plain, read
from tests.gpsearch.small import gpsearch, make_store, small, writing

SAID = ("metal: p1 and p3 trade off against each other (condition number up to 6e+05)",)


@pytest.fixture
def described():
    fit = Fit(("p0",), np.ones((3, 1)), np.full(3, 0.5), 0.5, 7)
    return Description(fit, {"light": 0.5, "other": math.inf}, Checks(0, 0, 0.5), 1.5, SAID)


def test_they_come_back_from_a_record_and_older_records_have_none(described):
    record = json.loads(json.dumps(plain(described)))
    assert read(record, Description).warnings == SAID
    del record["warnings"]
    assert read(record, Description).warnings == ()


def test_they_are_in_front_json(described, tmp_path):
    configuration = small(tmp_path)
    member = Member("p0", 1, Genome("p0", ()), 0, 1, described.fit, 0.5)
    with writing(make_store(tmp_path / "run", configuration.text())) as store, store.transaction():
        store.save_confirmed([member], 0, 1)
        store.save_description("p0", described)
        store.save_baseline("lambert", FormulaBaseline(described, 0.3))
    exported = json.loads(load_run(tmp_path / "run").to_text())
    jsonschema.validate(exported, schema(), jsonschema.Draft202012Validator)
    for (entry,) in (exported["front"], exported["baselines"]):
        assert entry["warnings"] == list(SAID)
        # A reader of older files does without.
        del entry["warnings"]
    jsonschema.validate(exported, schema(), jsonschema.Draft202012Validator)


def test_the_fit_command_says_them(tmp_path):
    found = gpsearch("fit", "p0 * p1", "builtin:metal", "--json", cwd=tmp_path)
    (said,) = (sentence for sentence in json.loads(found.stdout)["warnings"] if "trade off" in sentence)
    assert said.startswith("metal: p0 and p1 trade off")
