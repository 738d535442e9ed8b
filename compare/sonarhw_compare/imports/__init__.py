"""Scans recorded by other programs, and the board of a log."""
