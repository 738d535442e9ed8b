"""Okabe and Ito's palette: one meaning, one colour, on paper and in the window. Loads nothing that draws."""

PREDICTED = "#0072B2"
MEASURED = "#D55E00"
WALL = "#555555"
