"""Ray following: all paths of sound from a place back to it."""
