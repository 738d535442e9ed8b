"""Several scans at once: their list, and the view of their differences by heading."""
