"""Where measurements and reference numbers lie that are not part of the repository: beside the checkout."""

from pathlib import Path

SHARED = Path(__file__).resolve().parents[2] / "shared"
"""Tests that need it are skipped where it is not there."""
