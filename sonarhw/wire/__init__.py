"""The wire protocol: frames, messages and readings."""
