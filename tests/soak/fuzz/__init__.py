"""Fuzzed inputs of every command, loader and writer. `python -m tests.soak.fuzz FIRST COUNT` runs them by hand."""
