"""Pictures of what a run found."""

from gpsearch.reports.front_plot import plot_front

__all__ = ["plot_front"]
