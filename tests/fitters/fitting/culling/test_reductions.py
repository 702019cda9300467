"""The single steps of culling: smaller each, and what is tidied away is nothing."""

import numpy as np
import pytest

from fitters.expressions import parse, to_text
from fitters.expressions.canonical import canonical
from fitters.expressions.evaluation import evaluate_features
from fitters.expressions.simplification import tidy
from fitters.fitting.culling.reductions import complexity, reductions
from tests.random_expressions import random_features, random_tree

TREES = [random_tree(np.random.default_rng(seed), 5) for seed in range(300)]


@pytest.mark.parametrize(
    ("text", "tidied"),
    [
        ("p0 * 1 + 0 * sin(wi.z)", "p0"),
        ("pow(wh.z, 2 - 1) / 1", "wh.z"),
        ("--p0 - 0", "p0"),
        ("p0 + -wi.z", "p0 - wi.z"),
        ("-wi.z + p0", "p0 - wi.z"),
        ("0 - p0 - -wi.z", "-p0 + wi.z"),
        ("p0 * (1 / wi.z)", "p0 / wi.z"),
        ("max(p0, p0) * pow(p1, 0)", "p0"),
        ("dot(wn, wh) * dot(wi, wi)", "wh.z"),
        ("dot(wo, wh) / p0", "dot(wo, wh) / p0"),
        ("sqrt(4) * p0", "2 * p0"),
        ("p0 * (1 - 2)", "p0 * (1 - 2)"),
    ],
)
def test_tidying(text, tidied):
    assert to_text(tidy(parse(text))) == tidied


def test_tidying_leaves_values_as_they_are():
    rng = np.random.default_rng(0)
    seen = random_features(rng, 200)
    parameters = {f"p{i}": value for i, value in enumerate(rng.uniform(0.2, 2.0, 4))}
    compared = 0
    for tree in TREES:
        tidied = tidy(tree)
        before, after = (evaluate_features(e, parameters, seen) for e in (tree, tidied))
        finite = np.isfinite(before) & (np.abs(before) < 1e6)
        np.testing.assert_allclose(after[finite], before[finite], rtol=1e-6, atol=1e-9, err_msg=to_text(tree))
        assert tidied.nodes <= tree.nodes
        assert tidy(tidied).nodes <= tidied.nodes
        compared += finite.any() and tidied != tree
    assert compared > 50


def test_every_reduction_leads_to_another_and_simpler_formula():
    for tree in TREES[:30]:
        found = reductions(tree, dict.fromkeys(tree.parameters, 0.371), spare="p4")
        forms = {canonical(one.whole).text for one in found}
        assert len(forms) == len(found)
        for one in found:
            assert complexity(one.whole) < complexity(tree)
            assert set(one.whole.parameters) <= {*tree.parameters, "p4"}
            assert one.before != one.after


def test_whatever_a_part_may_become_is_tried():
    found = {
        canonical(r.whole).text
        for r in reductions(parse("p0 + max(p1 * wi.z, sqrt(p2))"), {"p0": 0.1, "p1": 5.0, "p2": 3.14}, "p3")
    }
    wanted = {
        "p0",
        "p0 + p1 * wi.z",
        "p0 + sqrt(p2)",
        "p0 + max(p1 * wi.z, p2)",
        "p0 + max(p1, sqrt(p2))",
        "p0 + max(wi.z, sqrt(p2))",
        "max(p1 * wi.z, sqrt(p2))",
        "p0 + max(p1 * wi.z, sqrt(p1))",
        "p0 + max(p1 * wi.z, sqrt(3))",
        "p0 + max(5 * wi.z, sqrt(p2))",
        "p0 + p3",
    }
    assert {canonical(parse(text)).text for text in wanted} <= found
