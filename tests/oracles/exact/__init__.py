"""Exact waves of small scenes, independent of rays."""
