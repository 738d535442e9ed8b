"""The live scanner: its thread, what it can be sent to do, and how it stands. No Qt."""
