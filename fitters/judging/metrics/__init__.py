"""The registry of metrics: how far a model is from a measurement.

To add a metric, add it to `METRICS` of the module of its kind, or name that of a new module in `METRICS` below;
the tests then run the suite `fitters.testing.metrics` on it.
"""

from fitters.judging.metrics import images, residuals, tables
from fitters.judging.metrics.contract import Compared, Comparison, Metric, registered
from fitters.judging.metrics.images import ImageMetric
from fitters.judging.metrics.residuals import COMPRESSIVE_POWER, COSINE, Residual, length, weighted_median

METRICS = registered(images.METRICS, residuals.METRICS, tables.METRICS)
"""All metrics by name."""

RESIDUALS = {
    name: metric
    for name, metric in METRICS.items()
    if isinstance(metric, Residual) and metric.measured_on == "light table"
}
"""Those that a fit can minimise: the choices of `metric` in a configuration."""

IMAGE_METRICS = {name: metric for name, metric in METRICS.items() if isinstance(metric, ImageMetric)}

CARD_METRICS = {name: metric for name, metric in METRICS.items() if metric.on_cards}
"""Those that an accuracy card shows, the image first."""

__all__ = [
    "CARD_METRICS",
    "COMPRESSIVE_POWER",
    "COSINE",
    "IMAGE_METRICS",
    "METRICS",
    "RESIDUALS",
    "Compared",
    "Comparison",
    "ImageMetric",
    "Metric",
    "Residual",
    "length",
    "weighted_median",
]
