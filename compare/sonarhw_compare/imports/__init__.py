"""Scans recorded by other programs, and the board that a log names."""
