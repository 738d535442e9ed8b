"""Causes of misfits: changes of rooms that `compare` has to find."""
