"""Export of readings as CSV and NPZ, and encoding of readings as a log."""
