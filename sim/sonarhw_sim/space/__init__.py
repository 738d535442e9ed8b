"""Paths over and under surfaces: horizontal and vertical sections of a room, and the rims of walls and posts."""
