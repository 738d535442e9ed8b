"""The state of the window and the actions of the user, without widgets."""
