"""Nanoseconds per evaluation of any model, by one harness: what a renderer that calls it would spend.

Every model becomes a compiled function of the same signature, (w_i, w_o) -> three channels, with all its geometry
inside: half vectors, cosines, the cell of a table. One compiled loop calls it through a pointer, as a renderer
calls a material, so that nothing is vectorised over directions and nothing is left out. All compute in float64;
tables lie in memory as their models hold them (the measured one in float32, the others in float64).

What to expect. Finding a table's cell is itself a formula: an arc cosine, an arc tangent and a hypotenuse at
least, one more arc tangent where phi_diff counts, and an arc cosine for each G. Small tables stay in the first or
second level of the cache and a read takes almost no time; the measured table (17.5 MB) does not, and every
evaluation waits for three lines of memory, one a channel. `python -m tests.benchmarks.speed` prints both beside
each other, with single transcendentals for scale.
"""

from fitters.judging.timing.closures import Closure, closure, empty
from fitters.judging.timing.harness import Timing, coherent, incoherent, measure

__all__ = ["Closure", "Timing", "closure", "coherent", "empty", "incoherent", "measure"]
