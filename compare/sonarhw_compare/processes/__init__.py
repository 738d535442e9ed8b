"""Processes that compute parts of one result at once."""
