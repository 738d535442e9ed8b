"""Sound on its way through the room, as positions over time and as a film."""
