"""The instrument: readings and scans, wire protocol, driver, fake scanner, logs, replay.

    from sonarhw import Scanner, sector

    with Scanner.open("/dev/ttyUSB0") as scanner:
        for reading in scanner.scan(sector(0, 360, 5)):
            print(reading.angle, reading.range)

Public names, which are loaded when they are first used; everything else in this package may change between versions:

- `Scanner`: a connected scanner. `Recorder`: the interface for recording its frames and readings.
- `Reading`, `Trace`: the result of one ping. `ScanOrder`, `sector`: the pings of a scan.
- `read_log`, `Log`, `LogWriter`, `LogMetadata`: recordings on disk.
- `FakeBoard`, `FaultyDevice`, `read_faults`, `serve`: a fake scanner, its faults, and a port that serves it.
- `EchoSource`, `Ping`, `PingResult`: the interface for the echoes of a fake scanner, for tests and simulations.
- `SonarError`: the base class of all errors in `sonarhw.errors`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
