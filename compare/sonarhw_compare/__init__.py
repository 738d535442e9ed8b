"""Measured held against predicted: match, explain, score, fit."""
