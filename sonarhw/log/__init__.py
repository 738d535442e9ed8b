"""Logs: `LogWriter` records, `read_log` reads a whole or torn log, `copy_log` writes a repaired copy.

A log is an uncompressed MCAP file with one chunk per reading. It contains the raw frames, which are authoritative, and
for other tools the decoded readings and one LaserScan per sweep. An index at its end lets it open at once. Traces stay
in the file.
"""

from sonarhw.log.contents import Log, LogMetadata, RecordedFrame, RecordedFrames, RecordedScan
from sonarhw.log.reader import read_log
from sonarhw.log.recovery import copy_log
from sonarhw.log.writer import LogWriter

__all__ = ["Log", "LogMetadata", "LogWriter", "RecordedFrame", "RecordedFrames", "RecordedScan", "copy_log", "read_log"]
