"""Causes of misfits: changes of the room that explain groups of readings which its prediction does not."""
