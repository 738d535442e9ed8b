"""The instrument: readings and scans, wire protocol, driver, fake scanner, logs, replay.

    from sonarhw import Scanner, sector

    with Scanner.open("/dev/ttyUSB0") as scanner:
        for reading in scanner.scan(sector(0, 360, 5)):
            print(reading.angle, reading.range)

Public names; everything else in this package may change between versions:

- `Scanner`: a connected scanner. `Recorder`: the interface for recording its frames and readings.
- `Reading`, `Trace`: the result of one ping. `ScanOrder`, `sector`: the pings of a scan.
- `read_log`, `Log`, `LogWriter`, `LogMetadata`: recordings on disk.
- `FakeBoard`, `FaultyDevice`, `read_faults`, `serve`: a fake scanner, its faults, and a port that serves it.
- `EchoSource`, `Ping`, `PingResult`: the interface for the echoes of a fake scanner, for tests and simulations.
- `SonarError`: the base class of all errors in `sonarhw.errors`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sonarhw.device.endpoint import serve
    from sonarhw.device.fake_board import FakeBoard
    from sonarhw.device.fault_schedule import read_faults
    from sonarhw.device.faulty_board import FaultyDevice
    from sonarhw.echo_source import EchoSource, Ping, PingResult
    from sonarhw.errors import SonarError
    from sonarhw.host.recorder import Recorder
    from sonarhw.host.scanner import Scanner
    from sonarhw.log import Log, LogMetadata, LogWriter, read_log
    from sonarhw.readings import Reading, ScanOrder, Trace, sector

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

_MODULES = {
    "sonarhw.device.endpoint": ("serve",),
    "sonarhw.device.fake_board": ("FakeBoard",),
    "sonarhw.device.fault_schedule": ("read_faults",),
    "sonarhw.device.faulty_board": ("FaultyDevice",),
    "sonarhw.echo_source": ("EchoSource", "PingResult", "Ping"),
    "sonarhw.errors": ("SonarError",),
    "sonarhw.host.recorder": ("Recorder",),
    "sonarhw.host.scanner": ("Scanner",),
    "sonarhw.log": ("Log", "LogMetadata", "LogWriter", "read_log"),
    "sonarhw.readings": ("Reading", "ScanOrder", "Trace", "sector"),
}


def __getattr__(name: str) -> Any:
    # imported on demand, so that a program that only uses readings does not load pyserial and the log libraries
    for module, names in _MODULES.items():
        if name in names:
            return getattr(import_module(module), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
