"""Commands that compare measured scans with predicted ones."""
