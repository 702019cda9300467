"""The benchmark of the baselines: `python -m tests.benchmarks.baselines [MODEL ...] [--data FOLDER]`.

Run it with OPENBLAS_NUM_THREADS=1 for times of one core.
"""

import json
import math
import os
import platform
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

import click
import numpy as np

from fitters.engine.warm import warm_up
from fitters.errors import FittersError
from fitters.expressions import parse, to_text
from fitters.expressions.catalogue import formula
from fitters.fitting import ConfirmJob, FitJob, FitSettings, Problem, confirm, model_errors
from fitters.judging.metrics import IMAGE_METRICS
from fitters.materials import Material, load_material
from fitters.models import BASELINES, FormulaModel, Model, fitter_of, material_fitter
from fitters.models.factors.objective import objective
from fitters.rendering import Picture, image_map
from fitters.scenes import Scene, light_table
from tests.benchmarks.problem import PROBE, SEED, data_folder
from tests.benchmarks.reference_materials import MaterialSet, authors_factors, material_sets
from tests.benchmarks.solvers import table as compared
from tests.benchmarks.table import Cell, Table

TABULATED = tuple(name for name in BASELINES if not fitter_of(name).together)
MODELS = (*(name for name in TABULATED if name != "power-iterations-anisotropic"), "cook-torrance", "ggx", "abc")
AUTHORS = "npf, the authors' tables"
PAPER_SECONDS = {"npf-independent-g": 2838, "npf-g-from-d": 765, "npf-naive": 680}
"""Table I of Bagher et al. 2016: the mean of all 100 materials, on one core of 2011; all starts."""
PAPER_ROUNDS = {"npf-independent-g": 1192, "npf-g-from-d": 56, "npf-naive": 2038}
PAPER_PSNR = {"bivariate": 64.07, "npf-independent-g": 58.22, "npf-g-from-d": 56.42, "npf-naive": 56.71}
"""Section 5 of the same: means over 100 materials and four scenes."""


@dataclass(frozen=True)
class Row:
    """One model on one material. `objective`: eq. 7, the mean of the ratios to the authors' tables."""

    model: str
    material: str
    light: float
    compressive: float
    psnr: float
    objective: float
    seconds: float
    iterations: float
    floats: int
    warnings: tuple[str, ...]


@click.command()
@click.argument("models", nargs=-1, type=click.Choice(BASELINES))
@click.option(
    "--data",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    default=data_folder,
    help="Folder with rgl/, merl/ and envmaps/; without one, built-in materials and light.",
)
@click.option("--first", type=int, default=None, help="So many materials of each set only.")
@click.option("--solvers", type=int, default=0, help="Compare both solvers, on so many materials of each set.")
@click.option("--rows", type=click.Path(dir_okay=False, path_type=Path), help="Write every row as JSON lines.")
def main(models: tuple[str, ...], data: Path | None, first: int | None, solvers: int, rows: Path | None) -> None:
    """Prints a table for each set of materials: of the named models, or of all that a run has beside its front."""
    click.echo(f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}")
    _warm(models or MODELS)
    for chosen in material_sets(data):
        if solvers:
            few = MaterialSet(chosen.title, chosen.names[:solvers], chosen.folder)
            click.echo(f"\n{few.title}\n{compared(few.materials(), data).text()}")
            continue
        found: list[Row] = []
        for material in MaterialSet(chosen.title, chosen.names[:first], chosen.folder).materials():
            found += measured(material, models or MODELS, data)
            click.echo(f"  {material.name}", err=True)
        click.echo(f"\n{summary(chosen.title, found).text()}")
        click.echo(f"\n{failures(chosen.title, found).text()}")
        if rows:
            with rows.open("a") as file:
                file.writelines(json.dumps(asdict(row)) + "\n" for row in found)


def _warm(models: Iterable[str]) -> None:
    warm_up()
    for name in models:
        if name in TABULATED:
            material_fitter(name).of_material(load_material("builtin:metal"))


def measured(material: Material, models: Iterable[str], data: Path | None) -> list[Row]:
    """The rows of a material: every model fitted, judged under the light, and seen in a picture."""
    scene = Scene(light=str(data / PROBE) if data else "studio")
    problem = Problem([material], light_table(scene), metric="light", cells=2048, seed=SEED)
    fitted: dict[str, tuple[Model, float, tuple[str, ...]]] = {}
    for name in models:
        try:
            fitted[name] = _fitted(name, problem)
        except FittersError as error:
            click.echo(f"  {material.name}, {name}: {error}", err=True)
    authors = authors_factors(data, material.name)
    if authors is not None:
        fitted[AUTHORS] = (authors, math.nan, ())
    images = _pictures(scene, material, [model for model, _, _ in fitted.values()])
    theirs = np.array(objective(material, authors)) if authors is not None else np.full(3, np.nan)
    rows = []
    for (name, (model, iterations, warnings)), image in zip(fitted.items(), images[1:], strict=True):
        errors = model_errors(problem, 0, model)
        rows.append(
            Row(
                model=name,
                material=material.name,
                light=_mean(errors["light"]),
                compressive=_mean(errors["compressive"]),
                psnr=IMAGE_METRICS["psnr"].compare(images[0], image).value,
                objective=float(np.mean(np.array(objective(material, model)) / theirs)),
                seconds=model.fit_seconds,
                iterations=iterations,
                floats=model.floats,
                warnings=warnings,
            )
        )
    return rows


def _fitted(name: str, problem: Problem) -> tuple[Model, float, tuple[str, ...]]:
    """A model of a problem's only material, the iterations of its fit, its warnings."""
    if name in TABULATED:
        fitted = material_fitter(name).of_material(problem.materials[0])
        return fitted.model, float(np.max(fitted.details["iterations"])), fitted.warnings
    return fitted_model(name, problem), math.nan, ()


def fitted_model(name: str, problem: Problem) -> FormulaModel:
    """A catalogue formula fitted to a problem's only material."""
    published = formula(name)
    bounds = tuple((symbol, *interval) for symbol, interval in published.bounds.items())
    text = to_text(published.expression)
    confirmed = confirm(problem, ConfirmJob(FitJob((text,), bounds, FitSettings())))
    columns = [confirmed.fit.names.index(symbol) for symbol in parse(text).parameters]
    model = FormulaModel(parse(text), confirmed.fit.values[:, columns])
    model.fit_seconds = confirmed.seconds
    return model


def _pictures(scene: Scene, material: Material, models: list[Model]) -> list[Picture]:
    """The sphere with the material, then with each model; where it was not measured all are black."""
    image = image_map(scene)
    return [image.of_material(material), *(image.of_model(model, material) for model in models)]


def _mean(errors: tuple[float, float, float]) -> float:
    return float(np.sqrt(np.mean(np.square(errors))))


def summary(title: str, rows: list[Row]) -> Table:
    """One line a model: medians over the materials, and what the papers report."""
    lines: list[tuple[Cell, ...]] = []
    for name in dict.fromkeys(row.model for row in rows):
        own = [row for row in rows if row.model == name]
        lines.append(
            (
                name,
                own[0].floats,
                _median(own, "light"),
                _median(own, "compressive"),
                _rounded(np.mean([row.psnr for row in own])),
                PAPER_PSNR.get(name),
                _median(own, "objective"),
                _worst(own, "objective"),
                _median(own, "seconds"),
                _worst(own, "seconds"),
                PAPER_SECONDS.get(name),
                _median(own, "iterations"),
                PAPER_ROUNDS.get(name),
            )
        )
    columns = (
        "model", "floats", "light", "compressive", "PSNR", "(paper)", "objective", "worst", "seconds", "worst",
        "(paper)", "iterations", "(paper)",
    )  # fmt: skip
    return Table(
        f"{title}: {len({row.material for row in rows})} materials",
        columns,
        tuple(lines),
        (
            "medians over the materials, PSNR (dB, sphere under the light) the mean",
            "objective: eq. 7 over that of the authors' tables, the mean of the channels",
            "(paper): Bagher et al. 2016, means of 100 MERL materials; PSNR of four scenes; one core of 2011",
        ),
    )


def failures(title: str, rows: list[Row]) -> Table:
    """For every model the three materials it explains worst, and how often it warned."""
    lines: list[tuple[Cell, ...]] = []
    for name in dict.fromkeys(row.model for row in rows):
        own = sorted((row for row in rows if row.model == name), key=lambda row: row.light, reverse=True)
        worst = ", ".join(f"{row.material} {row.light:.3f}" for row in own[:3])
        lines.append((name, sum(bool(row.warnings) for row in own), worst))
    return Table(f"{title}: where models fail", ("model", "with warnings", "largest light errors"), tuple(lines))


def _median(rows: list[Row], field: str) -> float | None:
    return _rounded(np.median([getattr(row, field) for row in rows]))


def _worst(rows: list[Row], field: str) -> float | None:
    return _rounded(max(getattr(row, field) for row in rows))


def _rounded(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


if __name__ == "__main__":
    main()
