"""Entries of results made up for tests: what a test does not ask for has some value."""

from typing import Any

from fitters.scenes import Scene
from gpsearch.genomes import Genome
from gpsearch.run import Baseline, FoundFormula, Result, RunInformation
from gpsearch.run.result import FOUND, FitOnTests, Origin


def information(**known: Any) -> RunInformation:
    given: dict[str, Any] = {
        "name": "x",
        "seed": 0,
        "version": "0",
        "config_sha256": "0",
        "materials": ("a",),
        "scene": Scene(),
        "metric": "light",
        "generations": 1,
        "candidates": 10,
        "seconds": 60.0,
    }
    return RunInformation(**(given | known))


def formula(name: str, error: float, nodes: int = 11, **known: Any) -> FoundFormula:
    genome = Genome("p0")
    given: dict[str, Any] = {
        "expression": "p0",
        "parameters": {"p0": {"a": (1.0, 1.0, 1.0)}},
        "errors": {"a": (error,) * 3},
        "metrics": {"light": error},
        "cost_ns": 10.0,
        "start": genome.start,
        "edits": genome.edits,
        "origin": Origin(0, 0),
        "checks": {"reciprocity": 0.0, "minimum": 0.0, "albedo_max": 1.0},
        "warnings": (),
    }
    return FoundFormula(id=name, error=error, nodes=nodes, **(given | known))


def baseline(name: str, error: float | None, kind: str = "table", **known: Any) -> Baseline:
    """A table, or a published formula where `expression` and `nodes` are given."""
    given: dict[str, Any] = {
        "floats": 9,
        "errors": {"a": (error,) * 3},
        "metrics": {"light": error},
        "cost_ns": 10.0,
        "warnings": (),
        "fit_seconds": 0.5,
    }
    return Baseline(name=name, error=error, kind=kind, **(given | known))


def entry(name: str, kind: str, error: float | None, **known: Any) -> FoundFormula | Baseline:
    """A formula that was found, or a baseline of another kind."""
    if kind == FOUND:
        assert error is not None
        return formula(name, error, **known)
    return baseline(name, error, kind, **known)


def on_tests(error: float | None) -> FitOnTests:
    return FitOnTests(error=error, errors={"b": (error,) * 3}, metrics={"light": error}, warnings=())


def result(*entries: FoundFormula | Baseline, **run: Any) -> Result:
    formulas = tuple(one for one in entries if isinstance(one, FoundFormula))
    return Result(information(**run), formulas, tuple(one for one in entries if isinstance(one, Baseline)))
