"""The echoes of the trace in the speed table: a hundred of them in 62 ms at 1 MHz."""

import numpy as np
from sonarhw_sim.board.signal import Arrivals

SPEED = 343.987  # m/s
LISTEN, RATE, ECHOES = 0.062, 1e6, 100


def hundred_echoes() -> Arrivals:
    """Return a hundred echoes all over the trace, 5 to 30° off the axis."""
    random = np.random.default_rng(1)
    angles = np.radians(random.uniform(5, 30, (2, ECHOES)))
    return Arrivals(
        random.uniform(0.001, 0.06, ECHOES), random.uniform(-0.1, 0.1, ECHOES), np.cos(angles[0]), np.cos(angles[1])
    )
