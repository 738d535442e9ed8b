"""Serial ports, and links to a scanner."""
