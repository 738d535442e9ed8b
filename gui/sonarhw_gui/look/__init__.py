"""Palette, theme, units and text size."""
