"""What a converged light table changes: `python -m tests.benchmarks.light [--data FOLDER] [--rows FILE]`.

Without a folder of data, built-in materials in the studio; with one the training materials of the genBRDF paper
(surrogates of MERL) under Grace Cathedral. Rows go to a file as they are made; what is there is not made again.
"""

import json
import resource
import time
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import click
import numpy as np
from scipy.stats import spearmanr

from fitters.engine.warm import warm_up
from fitters.fitting import Problem
from fitters.grid import CELLS, SHAPE, Array
from fitters.judging.card import model_values
from fitters.judging.metrics import METRICS, Compared
from fitters.materials import Material, load_material
from fitters.models import Model, fitter_of, material_fitter
from fitters.rendering import ImageMap, Picture, image_map
from fitters.rendering.maps import mapped
from fitters.scenes import EnvironmentMap, LightTable, Scene, light_table, load_light
from fitters.scenes.geometry import sphere
from fitters.scenes.sphere import sphere_light
from tests.benchmarks.baselines import fitted_model
from tests.benchmarks.point_sampled import point_sampled
from tests.benchmarks.problem import BUILT_IN, PROBE, SEED, data_folder
from tests.benchmarks.reference_materials import MaterialSet
from tests.benchmarks.table import Table

TRAINING = (
    "steel", "two-layer-gold", "green-metallic-paint", "red-metallic-paint",
    "maroon-plastic", "pvc", "green-acrylic", "dark-blue-paint",
)  # fmt: skip
MODELS = ("cook-torrance", "ggx", "abc", "genbrdf-metal", "genbrdf-dielectric", "bivariate", "npf-independent-g")
SAMPLINGS = ((64, 48), (128, 96), (192, 192))
"""Pixels across and rows of the map; the first is what the default was."""
SEEN = ("l2", "psnr", "1-ssim")
RESOLUTION = 96


@dataclass(frozen=True)
class Row:
    """A model fitted to a material under a table, judged by its error there and by a converged picture."""

    table: str
    material: str
    model: str
    light: float
    l2: float
    psnr: float
    ssim: float


@click.command()
@click.option(
    "--data", type=click.Path(exists=True, file_okay=False, path_type=Path), default=data_folder,
    help="Folder with merl/ and envmaps/; without one, built-in materials and light.",
)  # fmt: skip
@click.option("--first", type=int, default=None, help="So many materials only.")
@click.option("--rows", type=click.Path(dir_okay=False, path_type=Path), help="Keeps rows as JSON lines.")
def main(data: Path | None, first: int | None, rows: Path | None) -> None:
    scene = Scene(light=str(data / PROBE) if data else "studio", resolution=RESOLUTION)
    light = load_light(scene.light)
    click.echo(convergence(light).text() + "\n")
    click.echo(pictures(light, training(data, first)).text() + "\n")
    tables = {"point-sampled": point_sampled(light, *SAMPLINGS[0]), "converged": light_table(scene)}
    found = list(kept(rows, rows_of(training(data, first), tables, image_map(scene), _there(rows))))
    click.echo("\n\n".join(table.text() for table in (means(found), per_material(found), ranks(found))))


def training(data: Path | None, first: int | None) -> Iterator[Material]:
    """The materials, one after the other."""
    if data is None:
        yield from (load_material(name) for name in BUILT_IN[:first])
    else:
        yield from MaterialSet("MERL surrogates", TRAINING[:first], data / "merl").materials()


def convergence(light: EnvironmentMap, samplings: Iterable[tuple[int, int]] = SAMPLINGS) -> Table:
    """Distances of point-sampled tables from the closed form, and seconds."""
    began = time.perf_counter()
    limit = sphere_light(light)
    seconds = time.perf_counter() - began
    lines = [("closed form", 0.0, 0.0, 100.0, seconds)]
    point_sampled(light, 2, 2)
    for resolution, light_rows in samplings:
        began = time.perf_counter()
        table = point_sampled(light, resolution, light_rows)
        seconds = time.perf_counter() - began
        apart = [float(np.linalg.norm(a - b) / np.linalg.norm(b)) for a, b in zip(table.table, limit, strict=True)]
        lines.append(
            (f"{resolution} pixels, {light_rows} rows", min(apart), max(apart), _near(table, limit), seconds)
        )
    columns = ("table", "distance, least", "of channels, most", "% lit below 2 degrees", "seconds")
    return Table("Light tables: relative L2 distance from the closed form", columns, tuple(lines))


def _near(table: LightTable, limit: Array) -> float:
    """The share (%) of the cells below theta_half = 2 degrees which carry light that a table lights."""
    bins = int(np.ceil(np.sqrt(2.0 / 90.0) * SHAPE[0]))
    carrying = (limit[:, :bins] > 0).any(axis=0)
    return 100.0 * float(np.mean(table.lit[:bins][carrying]))


def pictures(light: EnvironmentMap, materials: Iterable[Material], resolution: int = RESOLUTION) -> Table:
    """How far pictures are from ones that are twice as fine in everything, and what a map takes."""
    geometry = sphere(resolution)
    began = time.perf_counter()
    arrays = mapped(light, geometry, 1)
    seconds = time.perf_counter() - began
    megabytes = sum(array.nbytes for array in arrays.values()) / 1e6

    def image(arrays: dict[str, np.ndarray]) -> ImageMap:
        return ImageMap(
            **arrays, pixels=geometry.pixels, facing=geometry.normals[:, 2], shape=geometry.shape, sha256=""
        )

    used, finer = image(arrays), image(mapped(light, geometry, 1, steps=6, azimuths=192, spread=1.0))
    lines = []
    for material in materials:
        first, second = (one.of_material(material).pixels for one in (used, finer))
        worst = np.abs(first - second).max(axis=-1)[used.picture(np.ones((len(used.cells), 3))).foreground]
        lines.append(
            (
                material.name,
                float(np.linalg.norm(first - second) / np.linalg.norm(second)),
                float(np.median(worst) / second.max()),
                float(worst.max() / second.max()),
            )
        )
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    return Table(
        f"Pictures of {resolution} pixels across, against ones twice as fine in everything",
        ("material", "L2", "median pixel, of the peak", "worst pixel"),
        tuple(lines),
        (f"the map took {seconds:.1f} s to build and {megabytes:.0f} MB; the process had {peak:.0f} MB at most",),
    )


def _there(path: Path | None) -> list[Row]:
    if path is None or not path.exists():
        return []
    return [Row(**json.loads(line)) for line in path.read_text().splitlines()]


def kept(path: Path | None, rows: Iterable[Row]) -> Iterator[Row]:
    """The rows, those that are not in a file yet written to it."""
    there = set(_there(path))
    for row in rows:
        if path is not None and row not in there:
            with path.open("a") as file:
                file.write(json.dumps(asdict(row)) + "\n")
        yield row


def rows_of(
    materials: Iterable[Material], tables: dict[str, LightTable], image: ImageMap, there: Iterable[Row] = ()
) -> Iterator[Row]:
    """Every model under every table, formulas fitted anew."""
    warm_up()
    done = {(row.table, row.material, row.model): row for row in there}
    for material in materials:
        truth = image.of_material(material)
        for name, light in tables.items():
            problem = Problem([material], light, metric="light", cells=2048, seed=SEED)
            for model in MODELS:
                key = (name, material.name, model)
                if key not in done:
                    fitted = (
                        material_fitter(model).kept(material).model
                        if not fitter_of(model).together
                        else fitted_model(model, problem)
                    )
                    done[key] = Row(*key, *_judged(fitted, material, light, image, truth))
                yield done[key]


def _judged(
    model: Model, material: Material, light: LightTable, image: ImageMap, truth: Picture
) -> tuple[float, float, float, float]:
    """The light error, and the errors of the picture."""
    values = model_values(model, material)
    picture = image.picture(values.reshape(3, CELLS)[:, image.cells].T)
    compared = Compared(material, light, values.reshape(3, *SHAPE), truth, picture)
    error, l2, psnr, ssim = (METRICS[metric].measure(compared).value for metric in ("light", *SEEN))
    return error, l2, psnr, ssim


FIELDS = ("light", "l2", "psnr", "ssim")


def means(rows: list[Row]) -> Table:
    """For every model the means over the materials, fitted under either table."""
    tables = list(dict.fromkeys(row.table for row in rows))
    lines = []
    for model in dict.fromkeys(row.model for row in rows):
        cells = []
        for field in FIELDS:
            for table in tables:
                own = [getattr(row, field) for row in rows if (row.model, row.table) == (model, table)]
                cells.append(float(np.mean(own)))
        lines.append((model, *cells))
    columns = tuple(f"{name}, {table}" for name in ("light", "L2", "PSNR", "1 - SSIM") for table in tables)
    materials = len({row.material for row in rows})
    return Table(
        f"Means over {materials} materials, judged by converged pictures", ("model", *columns), tuple(lines)
    )


def per_material(rows: list[Row]) -> Table:
    """Every model and material: fitted under the first table, and under the last."""
    first, last = rows[0].table, rows[-1].table
    of = {(row.table, row.material, row.model): row for row in rows}
    lines = []
    for _, material, model in [key for key in of if key[0] == first]:
        one, other = of[first, material, model], of[last, material, model]
        pairs = [(getattr(one, field), getattr(other, field)) for field in FIELDS]
        lines.append((material, model, *(value for pair in pairs for value in pair)))
    names = ("light", "L2", "PSNR", "1 - SSIM")
    columns = ("material", "model", *(f"{name}, {table}" for name in names for table in (first, last)))
    return Table("Every material", columns, tuple(lines))


def ranks(rows: list[Row]) -> Table:
    """Spearman's rank correlation of the light error with what a converged picture says."""
    lines = []
    for table in dict.fromkeys(row.table for row in rows):
        own = [row for row in rows if row.table == table]
        for kinds, chosen in (
            ("all models", own),
            ("formulas", [row for row in own if fitter_of(row.model).together]),
        ):
            light = [row.light for row in chosen]
            found = [
                float(spearmanr(light, [sign * getattr(row, field) for row in chosen]).statistic)
                for field, sign in (("l2", 1), ("psnr", -1), ("ssim", 1))
            ]
            lines.append((f"{table}, {kinds}", len(chosen), *found))
    columns = ("light error under", "pairs", "picture L2", "PSNR", "1 - SSIM")
    return Table(
        "Rank correlation of the light error with the picture, over models and materials", columns, tuple(lines)
    )


if __name__ == "__main__":
    main()
