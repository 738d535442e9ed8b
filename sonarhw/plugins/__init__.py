"""Devices that do not speak the wire protocol: the class to write one, and the scanner made of it."""
