"""The decoded channels of a log, which log viewers display. They are never read back."""
