"""Error against what a model costs: time of an evaluation, time of the fit, size."""

from gpsearch.charts.dominance import non_dominated
from gpsearch.charts.measuring import timed_fits, timings
from gpsearch.charts.models import AXES, Chart, Charted, chart_of
from gpsearch.charts.page import write_page
from gpsearch.charts.picture import write_pictures
from gpsearch.charts.table import entry, write_table

__all__ = [
    "AXES",
    "Chart",
    "Charted",
    "chart_of",
    "entry",
    "non_dominated",
    "timed_fits",
    "timings",
    "write_page",
    "write_pictures",
    "write_table",
]
