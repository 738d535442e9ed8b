"""The likelihood of readings for given parameters."""
