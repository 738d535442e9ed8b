"""Readings as ranges over heading, as a table and as a sentence."""
