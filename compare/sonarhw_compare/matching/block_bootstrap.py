"""Bootstrap of readings in blocks of neighbours, whose errors are alike."""

import numpy as np

from sonarhw.readings import FloatArray

DRAWS = 400


def drawn_blocks(readings: int, redundancy: float, random: np.random.Generator) -> FloatArray:
    """Return how often each reading is drawn, (draws, readings), if blocks of neighbours are drawn with replacement.

    A block has `redundancy` readings, which is the number of readings per independent reading.
    """
    length = max(1, round(redundancy))
    starts = random.integers(0, readings, (DRAWS, max(1, readings // length)))
    counts = np.zeros((DRAWS, readings))
    for by in range(length):
        np.add.at(counts, (np.arange(DRAWS)[:, None], (starts + by) % readings), 1.0)
    return counts
