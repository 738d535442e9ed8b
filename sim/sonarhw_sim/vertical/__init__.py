"""Paths over and under things: horizontal and vertical sections of a room."""
