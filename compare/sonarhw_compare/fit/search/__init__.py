"""Search for the best parameters, and samples of the posterior."""
