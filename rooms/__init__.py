"""Example room files; the demo scans laboratory.toml."""
