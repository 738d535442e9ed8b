"""Ray following: every path of sound from a place back to it."""
