"""The B-scan view."""
