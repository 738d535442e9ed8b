"""Files for the commands in README and docs."""
