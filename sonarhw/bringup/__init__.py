"""Checks of a new scanner."""
