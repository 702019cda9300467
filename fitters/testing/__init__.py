"""Contract suites: what a new entry of a registry must pass. They assert, and need no test framework."""
