"""The parameters of a fit, and its result."""
