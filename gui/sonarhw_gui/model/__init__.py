"""The scene and the content of the window at one moment, as frozen values without widgets."""
