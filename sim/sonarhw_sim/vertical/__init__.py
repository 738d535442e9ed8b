"""Paths over and under surfaces: horizontal and vertical sections of a room."""
