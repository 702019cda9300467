"""`gpsearch pick RUN`: the cheapest model that is good enough for a scene."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import click
from rich.console import Console

from fitters.scenes import light_table
from gpsearch.commands.described import described
from gpsearch.commands.progress import counted
from gpsearch.commands.runs import json_option, print_json, run_argument
from gpsearch.configuration import Configuration
from gpsearch.errors import GpsearchError
from gpsearch.judging.contenders import load_contenders, materials_of
from gpsearch.judging.offers import Offer, Refitter, Sharer, View, measured_nanoseconds, offers
from gpsearch.judging.picking import ORDERS, By, pick
from gpsearch.judging.scene_picks import ScenePicks, picks_json, picks_text
from gpsearch.judging.scenes import NamedScene, named_scene, scene_of
from gpsearch.judging.tolerance import EXAMPLE, Tolerance, parse_tolerance
from gpsearch.pictures.scene_plot import plot_scenes
from gpsearch.search.plan import plan, problem_recipe


@click.command("pick")
@run_argument
@click.option("--scene", "scenes", multiple=True, help="As of `gpsearch judge`, by default the run's; may repeat.")
@click.option("--tolerance", required=True, help=f"What every material must keep: {EXAMPLE}.")
@click.option(
    "--by", type=click.Choice(ORDERS), default="size", show_default=True, help="What is cheap, see above."
)
@click.option(
    "--plot", type=click.Path(path_type=Path), help="A picture (.png, .svg) of all models and the picks."
)
@json_option
def pick_command(
    run: Path, scenes: tuple[str, ...], tolerance: str, by: By, plot: Path | None, as_json: bool
) -> None:
    """Picks the cheapest model within a tolerance in a scene: of each material, and one for all.

    All of RUN competes, formulas and baselines. Where the scene is not the run's, formulas are also refitted in
    it; those that could win share parameters over channels, or over materials, as far as the tolerance holds.

    By size, a model costs the words to store: nodes of its formula and numbers, one each. By speed, nanoseconds
    per call on this machine, as in `gpsearch chart`. Exit status 0 also where nothing is within: the nearest is
    named.
    """
    limits = parse_tolerance(tolerance)
    if plot is not None and plot.suffix not in (".png", ".svg"):
        raise click.UsageError(f"--plot {plot}: a picture ends in .png or .svg")
    result = described(run)
    configuration = result.source
    if not result.entries:
        raise GpsearchError(f"{run}: nothing has been found yet; let `gpsearch launch` go on, then pick")
    materials = materials_of(configuration)
    with Console(stderr=True).status("loading the models"):
        competing = load_contenders(result, materials)
        nanoseconds = measured_nanoseconds(competing) if by == "speed" else {}
    seen = [named_scene(scene) for scene in scenes] or [scene_of(configuration)]
    picks = []
    for scene in seen:
        view = View(scene, materials, limits)
        refitter = _refitter(configuration, scene)
        elsewhere = scene.anywhere != scene_of(configuration).anywhere
        made = offers(competing, nanoseconds, view, refitter if elsewhere else None)
        offered = [offer for some in counted(made, len(competing), scene.name) for offer in some]
        with Console(stderr=True).status(f"{scene.name}: picking"):
            picks.append(_picks(scene, offered, view, refitter, limits, by))
    if plot is not None:
        plot_scenes(picks, limits, plot)
    if as_json:
        print_json(picks_json(picks, limits, by))
    else:
        click.echo("\n\n".join(picks_text(one, limits, by) for one in picks))


def _refitter(configuration: Configuration, scene: NamedScene) -> Refitter:
    recipe, planned = problem_recipe(configuration), plan(configuration)
    problem = replace(recipe, scene=scene.anywhere).build()
    return Refitter(problem, planned.bounds, planned.settings)


def _picks(
    scene: NamedScene, offered: Sequence[Offer], view: View, refitter: Refitter, limits: Tolerance, by: By
) -> ScenePicks:
    sharer = Sharer(refitter, view)
    alone = {name: pick(offered, (name,), limits, by, sharer) for name in view.materials}
    together = pick(offered, view.materials, limits, by, sharer)
    turned = replace(scene.anywhere, rotation=scene.scene.rotation + 180.0)
    return ScenePicks.of(scene, offered, alone, together, refitter, light_table(turned))
