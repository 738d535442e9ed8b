"""The live scanner: its thread, its jobs and its state. No Qt."""
