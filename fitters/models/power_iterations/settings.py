"""How finely a material is tabulated, and whether the paper's own implementation is repeated."""

from dataclasses import dataclass

from fitters.errors import FittersError


@dataclass(frozen=True)
class Settings:
    """`resolution` elevations (N of the paper), `azimuths` of the anisotropic tables; both at least 8.

    Power iterations end where no value of P changes by more than `tolerance`, relative, or after `iterations`.
    `published` repeats the paper's own implementation on isotropic materials, for comparison with its results.
    The default differs from it:

    - P beyond the last node goes on as under constant backscattering, cos^5; there the last P is forced to 0.
    - The power iterations run to convergence; there they are exactly 4.
    - The azimuthal integral of the kernel has its closed form; there 361 steps of a degree, 0.5 % too many.
    - Normalisation, G1 and moments are integrated over all slopes; there by left Riemann sums that leave out the
      end of the tail.
    - The GGX alpha is the first absolute moment of appendix C in both, here over all slopes. The tail assumed
      beyond the last node is lighter than GGX's: alpha comes out 0.2 to 1 % low for alpha 0.2 to 1 at 90 nodes.
    - The Fresnel term may exceed 1, which then shows that it is a residual; there it is clamped.
    - The Fresnel term averages over the azimuths too (eq. 20); there only phi_d = 90 degrees, a bin's edge.
    - Backscattering is read at the centres of the bins, over all valid phi_d; there truncated, in one cell.
    - P is a power of cos(theta) between its nodes, as Beckmann's tail and grazing slopes are; there linear.
    """

    resolution: int = 90
    azimuths: int = 90
    iterations: int = 200
    tolerance: float = 1e-12
    published: bool = False

    def __post_init__(self) -> None:
        for name in ("resolution", "azimuths"):
            if getattr(self, name) < 8:
                raise FittersError(f"{name} is {getattr(self, name)}: a table needs at least 8 nodes.")
        if self.iterations < 1 or not self.tolerance > 0:
            raise FittersError(
                f"iterations is {self.iterations}, tolerance {self.tolerance}: use at least one and more than 0."
            )

    @classmethod
    def reference(cls) -> "Settings":
        """The paper's own implementation at its resolution of 90."""
        return cls(published=True)
