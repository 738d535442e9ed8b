"""The list of echoes that might be reported."""
