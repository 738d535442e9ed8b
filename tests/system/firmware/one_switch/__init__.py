"""Homing by the mark alone."""
