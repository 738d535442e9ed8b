"""The content of the window at one moment, as frozen values."""
