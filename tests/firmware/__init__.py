"""Tests of the firmware: its portable part on this machine, the whole of it on an emulated board."""
