"""Evolution: islands of genomes as a pure function of seeds, and the search that drives them."""
