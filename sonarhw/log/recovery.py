"""Write the readable part of a torn log as a whole log with index and sweeps.

Its frames and their times are unchanged.
"""

from pathlib import Path

from sonarhw.log.contents import Log
from sonarhw.log.writer import LogWriter


def copy_log(log: Log, path: Path, *, overwrite: bool = False) -> None:
    """Write all of `log` to `path`. Raises LogError if it exists (unless `overwrite`) or cannot be written."""
    with LogWriter(path, log.metadata, overwrite=overwrite, live=False) as writer:
        for frames in log.frames.pieces():
            readings = [reading for frame in frames for reading in writer.take(frame)]
            for reading in readings:
                writer.reading(reading)
