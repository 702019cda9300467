"""`gpsearch transfer RUN`: what a run found, refitted to materials that it was not searched on."""

from pathlib import Path

import click
from rich.console import Console

from fitters.materials import Material, load_material
from gpsearch.commands.described import described
from gpsearch.commands.progress import counted
from gpsearch.commands.runs import json_option, print_json, run_argument
from gpsearch.configuration import Configuration
from gpsearch.errors import GpsearchError
from gpsearch.judging.contenders import load_contenders, materials_of
from gpsearch.judging.generality import Scored, scored
from gpsearch.judging.generality_report import Generality, generality_json, generality_text
from gpsearch.judging.materials import NamedMaterial, materials_of_run, named_material, require_different_names
from gpsearch.judging.scenes import scene_of
from gpsearch.judging.transfers import transfers, with_references, with_tests
from gpsearch.run import Result
from gpsearch.run.result import FOUND


@click.command("transfer")
@run_argument
@click.option("--material", "references", multiple=True, help="A file or built-in; by default all test materials.")
@click.option("--member", help="The id of the formula whose materials are listed; by default that of least error.")
@json_option
def transfer_command(run: Path, references: tuple[str, ...], member: str | None, as_json: bool) -> None:
    """Refits every member of RUN's front and every baseline to materials that it was not searched on.

    Train stands beside test: the run's error, L2 and 1 - SSIM of pictures, and how far a model lies below
    refitted Cook-Torrance and GGX, which are fitted for this where they are no baselines. One formula is listed
    by material.

    By default these are the run's `test_materials`. Others are fitted in this process and kept in the disk cache;
    nothing is written into the run.
    """
    result = described(run)
    configuration = result.source
    if not result.entries:
        raise GpsearchError(f"{run}: nothing has been found yet; let `gpsearch launch` go on, then transfer")
    chosen = _chosen(references, configuration)
    _require_member(member, result)
    train = materials_of(configuration)
    test = [load_material(one.reference) for one in chosen]
    _require_different(train, test)
    whole = _tested(result, chosen, again=bool(references))
    scene = scene_of(configuration)
    materials = (*train, *test)
    with Console(stderr=True).status("loading the models"):
        competing = load_contenders(whole, materials)
        image = scene.image()
    made = scored(competing, materials, image, configuration.metric)
    models = list(counted(made, len(competing), "judging"))
    generality = Generality(
        run=configuration.name,
        scene=scene,
        metric=configuration.metric,
        train=tuple(material.name for material in train),
        test=tuple(material.name for material in test),
        models=models,
        member=_member(member, models),
    )
    if as_json:
        print_json(generality_json(generality))
    else:
        click.echo(generality_text(generality))


def _chosen(references: tuple[str, ...], configuration: Configuration) -> list[NamedMaterial]:
    """The test materials that are asked for."""
    if not references:
        chosen = [one for one in materials_of_run(configuration) if one.role == "test"]
        if not chosen:
            raise GpsearchError(
                f"{configuration.name} has no test materials: name some with --material, or as `test_materials:`"
                " in its configuration and launch it again"
            )
        return chosen
    chosen = [named_material(reference, configuration) for reference in references]
    for reference, one in zip(references, chosen, strict=True):
        if one.role == "training":
            raise GpsearchError(
                f"--material {reference}: the run was searched on it; name materials that it was not searched on"
            )
    require_different_names(chosen)
    return chosen


def _require_different(train: tuple[Material, ...], test: list[Material]) -> None:
    """Raises `GpsearchError` where a test material is one of the search under another name."""
    known = {material.sha256: material.name for material in train}
    for material in test:
        if material.sha256 in known:
            raise GpsearchError(
                f"{material.name}: the run was searched on it, it holds what {known[material.sha256]} does; name"
                " materials with --material that it was not searched on"
            )


def _require_member(member: str | None, result: Result) -> None:
    ids = [formula.id for formula in result.formulas]
    if member is not None and member not in ids:
        known = f"there are {', '.join(ids)}" if ids else "the front is empty"
        raise GpsearchError(f"--member {member}: no formula of the front has this id; {known}")


def _tested(result: Result, chosen: list[NamedMaterial], *, again: bool) -> Result:
    """The result with the references, and with `test` of all, computed where it is missing or all `again`."""
    with Console(stderr=True).status("fitting the references"):
        whole = with_references(result, result.source)
    missing = [entry for entry in whole.entries if again or entry.test is None]
    made = transfers(missing, chosen, result.source)
    fits = dict(counted(made, len(missing) * len(chosen), "test materials"))
    return with_tests(whole, fits, chosen)


def _member(member: str | None, models: list[Scored]) -> Scored | None:
    """The one with an id, or the one of least error, which is the last of the front."""
    front = [one for one in models if one.contender.entry.kind == FOUND]
    if member is None:
        return front[-1] if front else None
    return next(one for one in front if one.contender.entry.name == member)
