"""Logs, the door: `LogWriter` records, `read_log` reads a whole or torn log, `copy_log` writes one anew.

The file is MCAP: uncompressed, one chunk a reading, the raw frames as the truth, decoded readings and one LaserScan a
sweep beside them for other tools, and at its end an index by which it is opened at once. Traces stay in the file.
"""

from sonarhw.log.contents import Log, LogMetadata, RecordedFrame, RecordedFrames, RecordedScan
from sonarhw.log.reader import read_log
from sonarhw.log.recovery import copy_log
from sonarhw.log.writer import LogWriter

__all__ = ["Log", "LogMetadata", "LogWriter", "RecordedFrame", "RecordedFrames", "RecordedScan", "copy_log", "read_log"]
