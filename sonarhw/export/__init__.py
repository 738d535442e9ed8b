"""Readings as CSV and NPZ, and readings encoded as a log."""
