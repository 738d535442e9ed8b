"""Writes a log anew: what could be read of a torn one becomes a whole one, with index and sweeps.

Takes a `Log` as it was read; hands on a file with the same frames at the same times.
"""

from pathlib import Path

from sonarhw.log_contents import Log
from sonarhw.log_writer import LogWriter
from sonarhw.recorded_scans import Follower


def copy_log(log: Log, path: Path, *, overwrite: bool = False) -> None:
    """Write all of `log` to `path`. Raises LogError where that exists (unless `overwrite`) or cannot be written."""
    follower = Follower()
    with LogWriter(path, log.metadata, overwrite=overwrite) as writer:
        for frame in log.frames:
            writer.frame(frame.received, frame.time, frame.wire)
            for reading in follower.take(frame):
                writer.reading(reading)
        for reading in follower.end():
            writer.reading(reading)
