"""The firmware for each combination of controller, ranging board and turntable."""
