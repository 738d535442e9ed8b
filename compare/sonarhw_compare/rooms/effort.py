"""The levels of effort of a search for a room."""

from enum import StrEnum


class Effort(StrEnum):
    """How long a room is searched for."""

    QUICK = "quick"  # headings and rough walls by few reflections, some seconds; shows where to scan next
    NORMAL = "normal"
    THOROUGH = "thorough"  # the normal search again from the room without each of the scans
