"""Devices that print text: one line for each reading, with an angle and a range."""
