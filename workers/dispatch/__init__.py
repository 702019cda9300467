"""Decides which work goes out, again and to whom, as a function of events."""
