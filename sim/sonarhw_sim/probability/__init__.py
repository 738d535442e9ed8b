"""The probability of each reading, from the spreads of the board and of the room."""
