"""Evolution: islands of genomes as a pure function of seeds."""
