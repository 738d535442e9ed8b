"""The search for the room that loaded scans show, and the panel that follows and corrects it."""
