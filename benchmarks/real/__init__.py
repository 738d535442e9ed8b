"""Benchmarks on real scans of a known room."""
