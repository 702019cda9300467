"""Non-parametric factor models of isotropic materials (Bagher et al. 2016)."""
