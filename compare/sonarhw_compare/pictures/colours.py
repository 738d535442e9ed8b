"""The palette of Okabe and Ito: each meaning has one colour, on paper and in the window."""

PREDICTED = "#0072B2"
MEASURED = "#D55E00"
WALL = "#555555"
SHORT = "#A0578A"
LONG = "#009E73"
EXTRA = "#E69F00"
MISSED = "#56B4E9"
