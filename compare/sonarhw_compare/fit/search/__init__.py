"""Search for the best parameters, and samples of their posterior."""
