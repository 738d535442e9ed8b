"""Explanations of single readings: the path of the first echo, and what would change it."""
