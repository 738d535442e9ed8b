"""Refinement of a draft by least squares: what can change, the errors of the ranges, the steps, and parts of walls."""
