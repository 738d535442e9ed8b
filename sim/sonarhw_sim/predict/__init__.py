"""Predicted scans by model, and the echo source of the fake scanner."""
