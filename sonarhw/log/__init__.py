"""Logs: `LogWriter` records, `read_log` reads a whole or torn log, `copy_log` writes a repaired copy.

A log is an uncompressed MCAP file with one chunk per reading. It contains the raw frames, from which this project
decodes the readings. For other tools it also contains the decoded readings and one LaserScan per sweep. With the index
at its end, a log opens at once. Traces are read from the file on access.
"""

from sonarhw.log.reader import Log, LogMetadata, RecordedFrame, RecordedFrames, RecordedScan, read_log
from sonarhw.log.writer import LogWriter, copy_log

__all__ = ["Log", "LogMetadata", "LogWriter", "RecordedFrame", "RecordedFrames", "RecordedScan", "copy_log", "read_log"]
