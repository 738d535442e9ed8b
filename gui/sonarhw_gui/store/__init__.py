"""Files that the window opens and saves."""
