"""The same search on a point-sampled and on the converged light table: `python -m tests.benchmarks.light_search`.

Both find a front, with several seeds; its formulas, as they were fitted there, are judged by converged pictures.
"""

import tempfile
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import click
import numpy as np

from fitters.expressions import parse
from fitters.fitting import Problem, ProblemRecipe
from fitters.judging.metrics import IMAGE_METRICS
from fitters.models.formula import formula_models
from fitters.rendering import image_map
from fitters.scenes import load_light
from gpsearch.run import Member, WritableStore
from gpsearch.run.lock import RunLock
from gpsearch.search.search import Search
from tests.benchmarks.light import RESOLUTION, SAMPLINGS, SEEN
from tests.benchmarks.point_sampled import point_sampled
from tests.benchmarks.problem import data_folder, recipe
from tests.benchmarks.runs import Silent, plan
from tests.benchmarks.table import Table
from workers import LocalSettings, Recipe, open_executor

SIZES = (23, 33, 41, 60)
"""The best formula of at most so many nodes is judged."""


@dataclass(frozen=True)
class Extent:
    seeds: int = 3
    islands: int = 4
    size: int = 48
    generations: int = 10


def point_sampled_problem(of: ProblemRecipe) -> Problem:
    """As `ProblemRecipe.build`, under the light table that was the default before tables converged."""
    problem = of.build()
    light = load_light(of.scene.light, base=Path(of.folder)).rotated(of.scene.rotation)
    return Problem(
        problem.materials,
        point_sampled(light, *SAMPLINGS[0]),
        metric=of.metric,
        cells=of.cells,
        confirm_cells=of.confirm_cells,
        seed=of.seed,
    )


TABLES = {"point-sampled": point_sampled_problem, "converged": ProblemRecipe.build}


@click.command()
@click.option("--data", type=click.Path(exists=True, file_okay=False, path_type=Path), default=data_folder)
@click.option("--seeds", type=int, default=Extent.seeds)
@click.option("--generations", type=int, default=Extent.generations)
def main(data: Path | None, seeds: int, generations: int) -> None:
    """Prints the mean over seeds of what the fronts hold."""
    click.echo(compared(recipe(data), Extent(seeds=seeds, generations=generations)).text())


def compared(of: ProblemRecipe, extent: Extent) -> Table:
    """For each table and size the means over seeds of the judgements of the best formula of at most that size."""
    lines = []
    judge = _Judge(of)
    for name, build in TABLES.items():
        fronts = [found(of, build, seed, extent) for seed in range(extent.seeds)]
        for size in SIZES:
            best = [front[-1] for all_ in fronts if (front := [m for m in all_ if m.nodes <= size])]
            if best:
                judged = np.mean([judge.judged(member) for member in best], axis=0)
                nodes, error = (float(np.mean([getattr(m, key) for m in best])) for key in ("nodes", "error"))
                lines.append((f"{name}, {size} nodes at most", len(best), nodes, error, *map(float, judged)))
    islands = f"{extent.islands} islands of {extent.size}, {extent.generations} generations"
    return Table(
        f"Fronts of {extent.seeds} seeds, {islands}",
        ("light table, formula", "seeds", "nodes", "its own error", "L2", "PSNR", "1 - SSIM"),
        tuple(lines),
        ("errors under different tables are not comparable; pictures are the same converged ones",),
    )


def found(of: ProblemRecipe, build: object, seed: int, extent: Extent) -> Sequence[Member]:
    """The front of a search."""
    planned = plan(
        of, islands=extent.islands, size=extent.size, generations=extent.generations, early_stopping=True
    )
    planned = replace(planned, seed=seed, recipe=Recipe(build, of))  # type: ignore[arg-type]
    with (
        tempfile.TemporaryDirectory() as folder,
        closing(WritableStore.create(RunLock(Path(folder)), "")) as store,
    ):
        with open_executor(LocalSettings()) as executor:
            Search(planned, store, executor, Silent()).run()
        return store.front().members


class _Judge:
    """Converged pictures of the materials, and of formulas of them."""

    def __init__(self, of: ProblemRecipe) -> None:
        self.materials = of.build().materials
        scene = replace(of.scene, resolution=RESOLUTION)
        self.image = image_map(scene, base=Path(of.folder))
        self.truths = [self.image.of_material(material) for material in self.materials]

    def judged(self, member: Member) -> list[float]:
        """Means over the materials of `SEEN`."""
        expression, values = parse(member.expression), []
        for i, (material, truth) in enumerate(zip(self.materials, self.truths, strict=True)):
            picture = self.image.of_model(formula_models(expression, member.fit, 0.0)[i], material)
            values.append([IMAGE_METRICS[metric].compare(truth, picture).value for metric in SEEN])
        return list(np.mean(values, axis=0))


if __name__ == "__main__":
    main()
