"""Readings in text: words and units, layouts, decoding of bytes, and proposals for unknown text."""
