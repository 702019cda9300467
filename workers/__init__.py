"""Where the work runs: one process, or a Dask cluster whose processes keep their heavy data loaded."""
