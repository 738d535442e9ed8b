"""A sweep as a foxglove.LaserScan protobuf message, which log viewers draw.

The range is +inf without an echo, and NaN at a heading without a reading.
"""

import math
from collections import defaultdict
from collections.abc import Sequence
from itertools import pairwise
from statistics import median_low

from foxglove_schemas_protobuf.LaserScan_pb2 import LaserScan

from sonarhw.readings import Reading
from sonarhw.wire.units import microdegrees_of, radians_of

FRAME_ID = "turntable"
_MOST_RANGES = 36_000  # 0.01° over a whole turn; a finer step comes from rounding


def laser_scan(readings: Sequence[Reading], time: float) -> LaserScan:
    """Return the message for the readings of one sweep, at least one. `time` (s since the epoch) is its time stamp.

    The message has equal steps only, so the ranges are on a grid of the smallest step between two headings. Of several
    pings at one heading the median range is used.
    """
    ranges = _by_heading(readings)
    headings = sorted(ranges)
    start, span = headings[0], headings[-1] - headings[0]
    step = max(min((after - before for before, after in pairwise(headings)), default=1), span / _MOST_RANGES)
    grid = [math.nan] * (round(span / step) + 1)
    for heading in headings:
        grid[round((heading - start) / step)] = median_low(ranges[heading])
    end = start + round(step * (len(grid) - 1))
    message = LaserScan(frame_id=FRAME_ID, start_angle=radians_of(start), end_angle=radians_of(end), ranges=grid)
    message.timestamp.FromNanoseconds(round(time * 1e9))
    message.pose.orientation.w = 1.0
    return message


def _by_heading(readings: Sequence[Reading]) -> dict[int, list[float]]:
    """Return the ranges of all pings at each heading, in whole microdegrees, as in the messages."""
    ranges: dict[int, list[float]] = defaultdict(list)
    for reading in readings:
        ranges[microdegrees_of(reading.angle)].append(math.inf if reading.range is None else reading.range)
    return ranges
