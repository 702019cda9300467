"""Error against what a model costs: time of an evaluation, time of the fit, size."""

from gpsearch.pictures.chart.measuring import timed_fits, timings
from gpsearch.pictures.chart.models import AXES, Chart, Charted, chart_of
from gpsearch.pictures.chart.page import write_page
from gpsearch.pictures.chart.picture import write_pictures
from gpsearch.pictures.chart.table import table_row, write_table

__all__ = [
    "AXES",
    "Chart",
    "Charted",
    "chart_of",
    "table_row",
    "timed_fits",
    "timings",
    "write_page",
    "write_pictures",
    "write_table",
]
