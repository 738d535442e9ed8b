"""Tests of the flashed firmware on the emulated board."""
