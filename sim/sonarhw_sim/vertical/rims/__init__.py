"""Paths that the level ends of walls and posts bend, in space."""
