"""The instrument: readings and scans, wire protocol, driver, fake scanner, logs, replay.

from sonarhw import Scanner, sector
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sonarhw.host.scanner import Scanner
    from sonarhw.readings import Reading, ScanOrder, Trace, sector

__all__ = ["Reading", "ScanOrder", "Scanner", "Trace", "sector"]


def __getattr__(name: str) -> Any:
    # on demand: whoever takes a reading from here needs no serial port
    if name == "Scanner":
        from sonarhw.host.scanner import Scanner

        return Scanner
    if name in __all__:
        from sonarhw import readings

        return getattr(readings, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
