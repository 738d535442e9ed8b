"""Refinement of a draft by least squares: what can change, the errors of the ranges, and the steps."""
