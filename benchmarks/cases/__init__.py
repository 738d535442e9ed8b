"""Rooms, reference implementations and window jobs that the benchmarks measure."""
