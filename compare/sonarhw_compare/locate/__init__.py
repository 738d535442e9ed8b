"""Find the pose of a scan in a known room."""
