"""`gpsearch judge RUN|MODEL`: accuracy cards, in numbers and pictures."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
from rich.console import Console

from fitters.baselines import KINDS, TABULATED
from fitters.expressions import to_text
from fitters.expressions.catalogue import CATALOGUE
from fitters.materials import Material, load_material
from fitters.models import FormulaModel
from fitters.models.saving import load as load_model
from fitters.rendering.card import METRIC_NAMES
from gpsearch.commands.described import described
from gpsearch.commands.fit_baseline import fit_tabulated
from gpsearch.commands.fit_formula import fit_formula
from gpsearch.commands.fit_outcome import Request
from gpsearch.commands.progress import counted
from gpsearch.commands.runs import json_option, make_folder, print_json
from gpsearch.configuration import Configuration
from gpsearch.errors import GpsearchError
from gpsearch.judging import Contender, contenders
from gpsearch.judging.cards import Judged, judged_json, protocols, shown
from gpsearch.judging.contenders import materials_of
from gpsearch.judging.scenes import NamedScene, named_scene, scene_of
from gpsearch.reports.card_sheet import card_sheet, number

SHORT = {
    "delta-e-2000": "dE 2000",
    "delta-e-itp": "dE ITP",
    "cosine-log": "cos-log",
    "cosine-cube-root": "cos-cbrt",
}


@click.command()
@click.argument("subject", metavar="RUN|MODEL")
@click.option("--material", "materials", multiple=True, help="A file or built-in; of a run, a name (default all).")
@click.option("--scene", help="studio, overcast, a map, or a configuration (.yaml); of a run by default its own.")
@click.option("-o", "--output", type=click.Path(path_type=Path), help="A folder for the pictures.")
@json_option
def judge(subject: str, materials: tuple[str, ...], scene: str | None, output: Path | None, as_json: bool) -> None:
    """Judges models in pictures of a scene and on the table: never by one metric alone.

    RUN is a run directory: every member of its front and every baseline is judged. MODEL is a published formula,
    an expression, a baseline, or a .npz file of `gpsearch fit --save`; what is no file is fitted first.

    With -o, a picture for each model: measured, model, error, and all metrics. --json adds how each is computed.
    """
    if output is not None:
        make_folder(output)
    if Path(subject).is_dir():
        competing, loaded, seen = _of_run(Path(subject), materials, scene)
    else:
        competing, loaded, seen = _of_model(subject, materials, scene or "studio")
    found = []
    for contender, pictures in counted(shown(competing, loaded, seen), len(competing), "judging"):
        found.append(Judged(contender, {one.material: one.card for one in pictures}))
        if output is not None and pictures:
            card_sheet(contender, pictures, seen.name, output / f"{_file_name(contender)}.png")
    if as_json:
        print_json(_report(found, loaded, seen))
    else:
        _print(found, loaded, seen)
        if output is not None:
            click.echo(f"pictures: {output}")


def _of_run(
    run: Path, names: tuple[str, ...], scene: str | None
) -> tuple[list[Contender], Sequence[Material], NamedScene]:
    exported, configuration = described(run)
    chosen = _chosen(materials_of(configuration), names, configuration)
    if not exported["front"] and not exported["baselines"]:
        raise GpsearchError(f"{run}: nothing has been found yet; let `gpsearch launch` go on, then judge")
    with Console(stderr=True).status("loading the models"):
        competing = contenders(exported, chosen)
    return competing, chosen, scene_of(configuration) if scene is None else named_scene(scene)


def _chosen(materials: Sequence[Material], names: tuple[str, ...], configuration: Configuration) -> list[Material]:
    """The materials of a run that are named, all by default; a name may also be the reference that the run has."""
    if not names:
        return list(materials)
    references = dict(zip(configuration.materials, materials, strict=True))
    known = {material.name: material for material in materials} | references
    for name in names:
        if name not in known:
            listed = ", ".join(material.name for material in materials)
            raise GpsearchError(f"--material {name}: the run has models of {listed}; only these can be judged")
    return [known[name] for name in names]


def _of_model(
    subject: str, references: tuple[str, ...], scene: str
) -> tuple[list[Contender], Sequence[Material], NamedScene]:
    if not references:
        raise click.UsageError(f"{subject} is no run directory: name the materials to judge it on with --material")
    materials = [load_material(reference, base=Path.cwd()) for reference in references]
    seen = named_scene(scene)
    return [_contender(subject, references, materials, seen)], materials, seen


def _contender(
    subject: str, references: tuple[str, ...], materials: Sequence[Material], seen: NamedScene
) -> Contender:
    """A model that is read from a file, or fitted under the scene's light."""
    if Path(subject).suffix == ".npz":
        model = load_model(Path(subject), KINDS)
        models, name, warnings = (model,) * len(materials), Path(subject).stem, ()
    else:
        request = Request(subject, references, seen.name, "light", seen.anywhere)
        outcome = fit_tabulated(request, None) if subject in TABULATED else fit_formula(request)
        models, name, warnings = outcome.models, subject, tuple(outcome.report["warnings"])
    first = models[0]
    formula = first if isinstance(first, FormulaModel) else None
    return Contender(
        name=name if name in (*CATALOGUE, *TABULATED) else "model",
        kind="formula" if formula else first.kind,
        expression=to_text(formula.expression) if formula else None,
        nodes=formula.expression.nodes if formula else None,
        floats=first.floats,
        error=None,
        fit_seconds=sum(model.fit_seconds for model in set(models)),
        warnings=warnings,
        models={material.name: model for material, model in zip(materials, models, strict=True)},
    )


def _file_name(contender: Contender) -> str:
    return f"{contender.nodes:03d}-{contender.name}" if contender.kind == "found" else contender.name


def _report(found: Sequence[Judged], materials: Sequence[Material], seen: NamedScene) -> dict[str, Any]:
    return {
        "scene": {"name": seen.name, **vars(seen.scene)},
        "materials": [material.name for material in materials],
        "metrics": protocols(),
        "models": [judged_json(one) for one in found],
    }


def _print(found: Sequence[Judged], materials: Sequence[Material], seen: NamedScene) -> None:
    """A line per model, by PSNR: means over the materials, and the material that looks worst."""
    click.echo(f"{len(found)} models, {len(materials)} materials, under {seen.name}; means over the materials")
    width = max(len(one.contender.title) for one in found)
    columns = "".join(f"{SHORT.get(name, name):>10s}" for name in METRIC_NAMES)
    click.echo(f"{'':{width}s}{columns}  worst material (FLIP)")
    for one in sorted((one for one in found if one.cards), key=lambda one: -one.mean("psnr")):
        values = "".join(f"{number(one.mean(name)):>10s}" for name in METRIC_NAMES)
        worst = one.worst_material("flip")
        region = one.cards[worst].worst
        where = (
            f"{worst} {number(one.cards[worst].metrics['flip'])}, most at {region.facing:.0f} deg from the view"
        )
        click.echo(f"{one.contender.title:{width}s}{values}  {where}")
    for one in found:
        if not one.cards:
            click.echo(f"{one.contender.title:{width}s}  not fitted: {'; '.join(one.contender.warnings)}")
        for warning in one.contender.warnings:
            click.echo(f"warning: {one.contender.title}: {warning}", err=True)
