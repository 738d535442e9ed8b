"""The wire protocol: frames, messages, and the readings in them."""
