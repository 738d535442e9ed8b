"""Readings as lines of CSV: what `scan --print` writes as they arrive and `log export` writes from a log.

Takes readings; hands on text without line ends, degrees and metres for a person and other programs to read.
"""

import math
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from sonarhw.readings import Reading

if TYPE_CHECKING:
    from sonarhw.log import RecordedScan

HEADER = "time_s,heading_deg,range_m,echoes_s"


def row(reading: Reading, began: float) -> str:
    """One line: seconds since the scan began, turntable angle in degrees, range in m, echo times in s joined by `;`.

    `began` is the start of the scan on the clock of `Reading.time`: the time stamp of the Started frame, in s.
    Without an echo range and echo times are empty.
    """
    distance = "" if reading.range is None else number(reading.range)
    echoes = ";".join(map(number, reading.echo_times))
    return f"{number(reading.time - began)},{number(math.degrees(reading.angle))},{distance},{echoes}"


def lines(scans: "Iterable[RecordedScan]") -> Iterator[str]:
    """The file that `log export` writes of those scans, line by line, with line ends."""
    yield HEADER + "\n"
    for scan in scans:
        yield from (row(reading, scan.began) + "\n" for reading in scan.readings)


def number(value: float) -> str:
    """A number with 9 significant digits, as in every CSV of this project; never `-0`."""
    return f"{value + 0.0:.9g}"
