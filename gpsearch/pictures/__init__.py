"""Pictures of what a run found."""

from gpsearch.pictures.front_plot import plot_front

__all__ = ["plot_front"]
