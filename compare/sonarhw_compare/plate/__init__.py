"""Calibration of a board from scans of a flat plate at known distances.

`plate_readings` collects what a log contains, `plate_signal` is the model, `level_fit`, `level_posterior`, `pulse_fit`
and `blanking_fit` determine values, and `plate_calibration` combines them and returns the profile.
"""
