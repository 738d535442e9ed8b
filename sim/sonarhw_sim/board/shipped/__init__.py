"""The included board profiles."""
