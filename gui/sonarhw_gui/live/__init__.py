"""Sources of readings: the live scanner and the replay of a log."""
