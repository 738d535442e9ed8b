"""Two scans from one place, compared by heading without a room."""
