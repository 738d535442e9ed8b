"""Commands that bring a new scanner up."""
