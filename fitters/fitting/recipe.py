"""The recipe of a fit problem: the few hundred bytes from which every process builds the same one."""

from dataclasses import dataclass, replace
from pathlib import Path

from fitters.engine.warm import warm_up
from fitters.fitting.problem import FitProblem, fit_problem
from fitters.materials import load_material
from fitters.scenes import Scene, light_table


@dataclass(frozen=True)
class ProblemRecipe:
    """Materials and light by reference (relative to `folder`), how many cells are sampled, and the seed."""

    materials: tuple[str, ...]
    scene: Scene
    metric: str
    sample_cells: int
    fine_cells: int
    seed: int
    folder: str

    def of(self, material: str) -> "ProblemRecipe":
        """The same for another material alone."""
        return replace(self, materials=(material,))


def build_problem(recipe: ProblemRecipe) -> FitProblem:
    """The problem of a recipe, and the engine made ready for it.

    Raises `FittersError` for a file that is missing or bad.
    """
    warm_up()
    folder = Path(recipe.folder)
    return fit_problem(
        [load_material(reference, base=folder) for reference in recipe.materials],
        light_table(recipe.scene, base=folder),
        metric=recipe.metric,
        sample_cells=recipe.sample_cells,
        fine_cells=recipe.fine_cells,
        seed=recipe.seed,
    )
