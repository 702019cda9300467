"""Fewer numbers for a formula: parameters that channels or materials share, where the scene cannot tell."""

from fitters.fitting.sharing.sharing import SCOPES, Scope, Sharing
from fitters.fitting.sharing.simplest import Shared, Unnoticed, share, within
from fitters.fitting.sharing.tied import tied_fit

__all__ = ["SCOPES", "Scope", "Shared", "Sharing", "Unnoticed", "share", "tied_fit", "within"]
