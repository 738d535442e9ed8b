"""Benchmarks: measurements to run by hand; no test depends on their results."""
