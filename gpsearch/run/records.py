"""JSON forms of what a store holds. Python writes floats so that they read back to the last bit, infinity too."""

import json
from collections.abc import Iterable
from functools import lru_cache
from typing import Any

import numpy as np

from fitters.fitting import Description, Fit
from fitters.fitting.culling import Culled, Step
from fitters.judging.checks import Checks
from fitters.models import Baseline, FormulaBaseline, TabulatedBaseline
from gpsearch.evolution.island import Individual
from gpsearch.genomes import Genome
from gpsearch.genomes.edits import Edit
from gpsearch.genomes.genome import edit_json
from gpsearch.run.front import Member
from gpsearch.run.transfers import Transfer

FORMULA = "formula"


def population_text(population: Iterable[Individual]) -> str:
    """JSON text of a population. Genomes grow by an edit a generation and share most of them: each is
    turned into text once.
    """
    return f"[{','.join(map(_individual_text, population))}]"


def _individual_text(individual: Individual) -> str:
    genome = individual.genome
    rest = (individual.expression, individual.nodes, individual.error)
    edits = ",".join(map(_edit_text, genome.edits))
    return f"[{json.dumps(genome.start)},[{edits}],{','.join(map(json.dumps, rest))}]"


@lru_cache(maxsize=1 << 18)
def _edit_text(edit: Edit) -> str:
    return json.dumps(edit_json(edit))


def read_individual(stored: list[Any]) -> Individual:
    start, edits, expression, nodes, error = stored
    return Individual(Genome.from_json(start, edits), expression, nodes, error)


def fit_json(fit: Fit) -> dict[str, Any]:
    return {
        "names": fit.names,
        "values": fit.values.tolist(),
        "errors": fit.errors.tolist(),
        "error": fit.error,
        "evaluations": fit.evaluations,
        "standard_error": fit.standard_error,
    }


def read_fit(stored: dict[str, Any]) -> Fit:
    names = tuple(stored["names"])
    values = np.array(stored["values"], np.float64).reshape(len(stored["errors"]), len(names))
    return Fit(
        names=names,
        values=values,
        errors=np.array(stored["errors"], np.float64),
        error=stored["error"],
        evaluations=stored["evaluations"],
        standard_error=stored["standard_error"],
    )


def member_json(member: Member) -> dict[str, Any]:
    return {
        "expression": member.expression,
        "nodes": member.nodes,
        "start": member.genome.start,
        "edits": member.genome.to_json(),
        "island": member.island,
        "generation": member.generation,
        "fit": fit_json(member.fit),
        "screened": member.screened,
    }


def read_member(stored: dict[str, Any]) -> Member:
    return Member(
        expression=stored["expression"],
        nodes=stored["nodes"],
        genome=Genome.from_json(stored["start"], stored["edits"]),
        island=stored["island"],
        generation=stored["generation"],
        fit=read_fit(stored["fit"]),
        screened=stored["screened"],
    )


def description_json(description: Description) -> dict[str, Any]:
    return {
        "fit": fit_json(description.fit),
        "metrics": description.metrics,
        "checks": vars(description.checks),
        "cost_ns": description.cost_ns,
        "warnings": list(description.warnings),
    }


def read_description(stored: dict[str, Any]) -> Description:
    return Description(
        fit=read_fit(stored["fit"]),
        metrics=stored["metrics"],
        checks=Checks(**stored["checks"]),
        cost_ns=stored["cost_ns"],
        # Stores made before formulas had warnings hold none.
        warnings=tuple(stored.get("warnings", ())),
    )


def culled_json(culled: Culled) -> dict[str, Any]:
    return {
        "expression": culled.expression,
        "steps": [vars(step) for step in culled.steps],
        "description": culled.description and description_json(culled.description),
    }


def read_culled(stored: dict[str, Any]) -> Culled:
    steps = (step | {"nodes": tuple(step["nodes"]), "error": tuple(step["error"])} for step in stored["steps"])
    description = stored["description"] and read_description(stored["description"])
    return Culled(stored["expression"], tuple(Step(**step) for step in steps), description)


def baseline_json(baseline: Baseline) -> dict[str, Any]:
    if isinstance(baseline, FormulaBaseline):
        description = description_json(baseline.description)
        return {"kind": FORMULA, "description": description, "fit_seconds": baseline.fit_seconds}
    return vars(baseline)


def read_baseline(stored: dict[str, Any]) -> Baseline:
    # Stores made when formulas were the only baselines do not name the kind.
    if stored.get("kind", FORMULA) == FORMULA:
        return FormulaBaseline(read_description(stored["description"]), stored["fit_seconds"])
    errors = {metric: tuple(values) for metric, values in stored["errors"].items()}
    return TabulatedBaseline(**(stored | {"errors": errors, "warnings": tuple(stored["warnings"])}))


def transfer_json(transfer: Transfer) -> dict[str, Any]:
    return vars(transfer)


def read_transfer(stored: dict[str, Any]) -> Transfer:
    return Transfer(
        errors=tuple(stored["errors"]),
        metrics=stored["metrics"],
        parameters={name: tuple(values) for name, values in stored["parameters"].items()},
        warnings=tuple(stored["warnings"]),
    )


def read_stages(text: str) -> dict[str, Any]:
    """The fields of a generation that have no column of their own."""
    stored = json.loads(text)
    # Stores made before it was noted when something came to the front hold the stages alone.
    if "stages" not in stored:
        return {"stages": stored}
    arrived = tuple((nodes, error) for nodes, error in stored["arrived"])
    return {"stages": stored["stages"], "at": stored["at"], "arrived": arrived}
