# The public names; each is loaded when it is first used.
from .device.endpoint import serve
from .device.fake_board import FakeBoard
from .device.fault_schedule import read_faults
from .device.faulty_board import FaultyDevice
from .echo_source import EchoSource, Ping, PingResult
from .errors import SonarError
from .host.recorder import Recorder
from .host.scanner import Scanner
from .log import Log, LogMetadata, LogWriter, read_log
from .readings import Reading, ScanOrder, Trace, sector

__all__ = [
    "EchoSource",
    "FakeBoard",
    "FaultyDevice",
    "Log",
    "LogMetadata",
    "LogWriter",
    "Ping",
    "PingResult",
    "Reading",
    "Recorder",
    "ScanOrder",
    "Scanner",
    "SonarError",
    "Trace",
    "read_faults",
    "read_log",
    "sector",
    "serve",
]
