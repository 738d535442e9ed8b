"""The state of the window and what a person does to it, without widgets."""
