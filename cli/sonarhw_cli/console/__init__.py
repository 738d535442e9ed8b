"""Options, inputs, outputs, progress bars and interruption, shared by the commands."""
