"""The search: a configuration turned into a plan, and the loop that drives islands, fits and the front."""
