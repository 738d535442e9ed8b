"""What is probably wrong in a room that can be read, and why a prediction has no echo."""
