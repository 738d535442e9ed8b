"""What a search for the room draws in the plan: walls and posts found so far, readings, and the next place to scan."""

from dataclasses import dataclass

import numpy as np

from sonarhw.readings import FloatArray

NO_POINTS = np.empty((0, 2))


@dataclass(frozen=True, eq=False)
class NextScan:
    """A place for another scan."""

    position: tuple[float, float]  # m
    sectors: tuple[tuple[float, float], ...]  # rad: begin and end of the headings with most of the gain


@dataclass(frozen=True, eq=False)
class FoundDrawing:
    """Surfaces and points in the plan, m."""

    walls: FloatArray  # (n, 4)
    posts: FloatArray  # (m, 3)
    chosen_walls: FloatArray  # (0 or 1, 4), the selected one
    chosen_posts: FloatArray  # (0 or 1, 3)
    speaking_for: FloatArray  # (k, 2), echoes that speak for the selected wall or post
    against: FloatArray  # (l, 2)
    next_scan: NextScan | None = None
