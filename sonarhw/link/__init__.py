"""Serial links and ports."""
