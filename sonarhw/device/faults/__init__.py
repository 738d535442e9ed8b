"""A fake board with faults: lost and damaged bytes, resets, unplugged cables, silence."""
