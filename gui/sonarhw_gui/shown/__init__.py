"""What the window shows at one moment, as frozen values."""
