"""Replay of a log, for a viewer and as a live scanner."""
