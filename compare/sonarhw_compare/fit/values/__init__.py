"""The quantities, parameters and results of a fit."""
