"""What the commands share: options, inputs, outputs, progress bars and interruption."""
