"""The speeds at which the window plays a log back; the playback itself is `sonarhw.replay.playback`."""

import math

from sonarhw.replay.playback import Playback

__all__ = ["SPEEDS", "Playback"]

SPEEDS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, math.inf)
