"""The search: a configuration turned into a plan, and the loop that drives islands, fits and the front."""

from gpsearch.search.plan import Budget, Plan, plan
from gpsearch.search.search import Search, Standing, Watcher

__all__ = ["Budget", "Plan", "Search", "Standing", "Watcher", "plan"]
