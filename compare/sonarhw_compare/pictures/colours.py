"""Okabe and Ito's palette: one meaning, one colour, on paper and in the window. Loads nothing that draws."""

PREDICTED = "#0072B2"
MEASURED = "#D55E00"
WALL = "#555555"
SHORT = "#A0578A"
LONG = "#009E73"
EXTRA = "#E69F00"
MISSED = "#56B4E9"
