"""What a chart measures on this machine: times of evaluations and of fits."""

from collections.abc import Iterator, Sequence

from fitters.fitting import ConfirmJob, confirm
from fitters.judging.timing import Timing, closure, coherent, empty, incoherent, measure
from fitters.materials import Material
from fitters.models import MeasuredTable, Model
from gpsearch.configuration import Configuration
from gpsearch.judging.contenders import Contender
from gpsearch.pictures.chart.models import MEASURED
from gpsearch.run.result import FOUND
from gpsearch.search.plan import plan, problem_recipe

EMPTY = "empty"


def timings(
    contenders: Sequence[Contender], material: Material
) -> tuple[dict[str, Timing], dict[str, Timing], Timing]:
    """Times at incoherent and coherent directions by name, `MEASURED` among them, and that of an empty call.

    Each is timed with its model of one of the run's materials: what others of them cost differs by noise only.
    """
    models: dict[str, Model] = {
        one.entry.name: one.models[material.name] for one in contenders if material.name in one.models
    }
    models[MEASURED] = MeasuredTable(material.table)
    closures = {name: closure(model) for name, model in models.items()} | {EMPTY: empty()}
    first, second = measure(closures, incoherent()), measure(closures, coherent())
    return first, second, first[EMPTY]


def timed_fits(configuration: Configuration, contenders: Sequence[Contender]) -> Iterator[tuple[str, float]]:
    """Ids of the formulas, which have no such time, each with the seconds of its fit to all materials.

    One fit after the other, in this process.
    """
    untimed = [one.entry for one in contenders if one.entry.kind == FOUND]
    if not untimed:
        return
    problem, planned = problem_recipe(configuration).build(), plan(configuration)
    for one in untimed:
        yield one.name, confirm(problem, ConfirmJob(planned.job(str(one.expression)))).seconds
