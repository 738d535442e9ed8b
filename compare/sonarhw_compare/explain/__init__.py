"""Explanations of single readings: which path won, and what would change that."""
