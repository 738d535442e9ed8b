"""The plan view of the room, and the tools that edit it."""
