"""Calibration of a board from scans of a known room, and echoes of the sensor's own carrier.

`own_body_search` finds the carrier's echoes, `starting_turntable` headings and turntable scale to begin with,
`turntable_fit` the geometry by the likelihood of `fit`, and `detection_rule` threshold and aperture.
`room_calibration` combines them and returns the profile, and `calibration_picture` draws before and after.
"""
