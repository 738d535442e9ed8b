"""The panels at the side of the window, and the replay bar."""
