"""Benchmarks: measurements that print tables and assert nothing. `python -m tests.benchmarks.engine`."""
