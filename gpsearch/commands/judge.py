"""`gpsearch judge RUN|MODEL`: accuracy cards, in numbers and pictures."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
from rich.console import Console

from fitters.expressions import to_text
from fitters.fitting import Problem
from fitters.judging.metrics import CARD_METRICS
from fitters.materials import Material, load_material
from fitters.models import MODELS, fitter_of, load
from gpsearch.commands.described import described
from gpsearch.commands.progress import counted
from gpsearch.commands.runs import json_option, make_folder, print_json
from gpsearch.errors import GpsearchError
from gpsearch.judging.cards import CardsOfModel, judged_json, protocols, shown
from gpsearch.judging.contenders import Contender, joined, load_contenders
from gpsearch.judging.materials import materials_of_run, named_material, require_different_names
from gpsearch.judging.scenes import NamedScene, named_scene, scene_of
from gpsearch.judging.transfers import transfers, with_tests
from gpsearch.pictures.card_sheet import card_sheet, number
from gpsearch.run import Baseline
from gpsearch.run.result import FOUND


@click.command()
@click.argument("subject", metavar="RUN|MODEL")
@click.option(
    "--material", "materials", multiple=True, help="A file or built-in; of a run, also a name (default all)."
)
@click.option("--scene", help="studio, overcast, a map, or a configuration (.yaml); of a run by default its own.")
@click.option("-o", "--output", type=click.Path(path_type=Path), help="A folder for the pictures.")
@json_option
def judge(subject: str, materials: tuple[str, ...], scene: str | None, output: Path | None, as_json: bool) -> None:
    """Judges models in pictures of a scene and on the table: never by one metric alone.

    RUN is a run directory: every member of its front and every baseline is judged, on the materials of the search
    and, apart from them, on test materials. To a file that is new to the run all of them are refitted first. MODEL
    is a published formula, an expression, a baseline, or a .npz file of `gpsearch fit --save`; what is no file is
    fitted first.

    With -o, a picture for each model: measured, model, error, and all metrics. --json adds how each is computed.
    """
    if output is not None:
        make_folder(output)
    if Path(subject).is_dir():
        asked = _of_run(Path(subject), materials, scene)
    else:
        asked = _of_model(subject, materials, scene or "studio")
    loaded, seen = (*asked.materials, *asked.tests), asked.scene
    judged = []
    for contender, pictures in counted(shown(asked.contenders, loaded, seen), len(asked.contenders), "judging"):
        judged.append(CardsOfModel(contender, {one.material: one.card for one in pictures}))
        if output is not None and pictures:
            path = output / f"{_file_name(contender)}.png"
            card_sheet(contender, pictures, seen.name, path, tests=_names(asked.tests))
    if as_json:
        print_json(_report(judged, asked))
    else:
        _print(judged, asked)
        if output is not None:
            click.echo(f"pictures: {output}")


@dataclass(frozen=True, eq=False)
class _Asked:
    """What is to be judged: on materials, and apart from them on tests, which a run was not searched on."""

    contenders: Sequence[Contender]
    materials: Sequence[Material]
    tests: Sequence[Material]
    scene: NamedScene


def _names(materials: Sequence[Material]) -> list[str]:
    return [material.name for material in materials]


def _of_run(run: Path, names: tuple[str, ...], scene: str | None) -> _Asked:
    result = described(run)
    configuration = result.source
    chosen = dict.fromkeys(named_material(name, configuration) for name in names)
    chosen = chosen or dict.fromkeys(materials_of_run(configuration))
    require_different_names(chosen)
    if not result.entries:
        raise GpsearchError(f"{run}: nothing has been found yet; let `gpsearch launch` go on, then judge")
    loaded = {one: load_material(one.reference) for one in chosen}
    new = [one for one in chosen if one.role == "new"]
    fits = counted(transfers(result.entries, new, configuration), len(result.entries) * len(new), "new materials")
    refitted = with_tests(result, dict(fits), new) if new else result
    with Console(stderr=True).status("loading the models"):
        competing = [
            joined(*of_one)
            for of_one in zip(
                load_contenders(result, [material for one, material in loaded.items() if one.role != "new"]),
                load_contenders(refitted, [loaded[one] for one in new]),
                strict=True,
            )
        ]
    return _Asked(
        competing,
        [material for one, material in loaded.items() if one.role == "training"],
        [material for one, material in loaded.items() if one.role != "training"],
        scene_of(configuration) if scene is None else named_scene(scene),
    )


def _of_model(subject: str, references: tuple[str, ...], scene: str) -> _Asked:
    if not references:
        raise click.UsageError(f"{subject} is no run directory: name the materials to judge it on with --material")
    materials = [load_material(reference, base=Path.cwd()) for reference in references]
    seen = named_scene(scene)
    return _Asked([_contender(subject, materials, seen)], materials, (), seen)


def _contender(subject: str, materials: Sequence[Material], seen: NamedScene) -> Contender:
    """A model that is read from a file, or fitted under the scene's light."""
    if Path(subject).suffix == ".npz":
        fitted = load(Path(subject))
        models, name = (fitted.model,) * len(materials), Path(subject).stem
        warnings: tuple[str, ...] = ()
    else:
        fitted = fitter_of(subject).fit(Problem(materials, seen.anywhere))
        models, name, warnings = tuple(fitted[one] for one in fitted.materials), subject, fitted.warnings
    first = models[0]
    entry = Baseline(
        name=name if name in MODELS else "model",
        kind=first.kind,
        expression=to_text(first.expression) if first.expression else None,
        nodes=first.expression.nodes if first.expression else None,
        floats=first.floats,
        error=None,
        errors={},
        metrics={},
        cost_ns=first.cost_ns(),
        warnings=warnings,
        fit_seconds=sum(model.fit_seconds for model in set(models)),
    )
    models_by_name = {material.name: model for material, model in zip(materials, models, strict=True)}
    return Contender(entry, models_by_name, warnings)


def _file_name(contender: Contender) -> str:
    entry = contender.entry
    return f"{entry.nodes:03d}-{entry.name}" if entry.kind == FOUND else entry.name


def _report(judged: Sequence[CardsOfModel], asked: _Asked) -> dict[str, Any]:
    tests = _names(asked.tests)
    return {
        "scene": {"name": asked.scene.name, **vars(asked.scene.scene)},
        "materials": _names(asked.materials),
        **({"test_materials": tests} if tests else {}),
        "metrics": protocols(),
        "models": [judged_json(one, tests) for one in judged],
    }


def _print(judged: Sequence[CardsOfModel], asked: _Asked) -> None:
    """A table for the materials, one for the tests, and what is to be known of the fits."""
    under = f"under {asked.scene.name}; means over the materials"
    if asked.materials:
        click.echo(f"{len(judged)} models, {len(asked.materials)} materials, {under}")
        _print_table([one.only(_names(asked.materials)) for one in judged])
    if asked.tests:
        gap = "\n" if asked.materials else ""
        many = f"{len(asked.tests)} test material{'s' if len(asked.tests) > 1 else ''}"
        click.echo(f"{gap}{len(judged)} models, {many} that the search was not on, {under}")
        _print_table([one.only(_names(asked.tests)) for one in judged])
    for one in judged:
        for warning in one.contender.warnings:
            click.echo(f"warning: {one.contender.entry.title}: {warning}", err=True)


def _print_table(judged: Sequence[CardsOfModel]) -> None:
    """A line per model, by PSNR: means over the materials, and the material that looks worst."""
    width = max(len(one.contender.entry.title) for one in judged)
    columns = "".join(f"{metric.short:>10s}" for metric in CARD_METRICS.values())
    click.echo(f"{'':{width}s}{columns}  worst material (FLIP)")
    for one in sorted((one for one in judged if one.cards), key=lambda one: -one.mean("psnr")):
        values = "".join(f"{number(one.mean(name)):>10s}" for name in CARD_METRICS)
        worst = one.worst_material("flip")
        region = one.cards[worst].worst
        where = (
            f"{worst} {number(one.cards[worst].metrics['flip'])}, most at {region.facing:.0f} deg from the view"
        )
        click.echo(f"{one.contender.entry.title:{width}s}{values}  {where}")
    for one in judged:
        if not one.cards:
            click.echo(f"{one.contender.entry.title:{width}s}  not fitted: {'; '.join(one.contender.warnings)}")
