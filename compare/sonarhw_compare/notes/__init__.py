"""Notes on readings, kept in a file beside the log."""
