"""Write the readable part of a torn log as a whole log with index and sweeps.

Its frames and their times are unchanged.
"""

from pathlib import Path

from sonarhw.atomic_file import atomic_file
from sonarhw.log.contents import Log
from sonarhw.log.writer import LogWriter


def copy_log(log: Log, path: Path, *, overwrite: bool = False) -> None:
    """Write all of `log` to `path`, completely or not at all.

    Raises OutputError if the file exists (unless `overwrite`) or cannot be written, NotALog if `log` can no longer be
    read.
    """
    with atomic_file(path, overwrite=overwrite) as file, LogWriter(file, log.metadata) as writer:
        received = log.frames.received_bytes()
        ahead = next(received, None)
        for frames in log.frames.pieces():
            while ahead is not None and ahead[0] <= frames[-1].time:
                writer.received_bytes(*ahead)
                ahead = next(received, None)
            readings = [reading for frame in frames for reading in writer.take(frame)]
            for reading in readings:
                writer.reading(reading)
        for one in (ahead, *received) if ahead else ():
            writer.received_bytes(*one)
