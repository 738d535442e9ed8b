"""Calibration of a board from scans of a flat plate or of a known room."""
