"""The HTML report about one scan."""
