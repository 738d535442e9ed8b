"""The scene (room, place and board) and its edits, without widgets."""
