"""A second, slow prediction of readings, by exhaustive search: it shares no code with the product."""
