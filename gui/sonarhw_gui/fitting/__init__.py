"""The fit of the scanner's pose, as a request to a thread and as a state."""
