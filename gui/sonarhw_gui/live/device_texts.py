"""The texts of the device panel: who answers, the state of the line, the size of a scan."""

import math

from sonarhw.host.device_info import DeviceInfo
from sonarhw.readings import ScanOrder, headings_between
from sonarhw.wire.device_clock import MOST_DRIFT
from sonarhw.wire.limits import MOST_READINGS
from sonarhw.wire.units import microdegrees_of
from sonarhw_gui.live.scanner_state import LinkState
from sonarhw_gui.live.window_status import Source, Status

UNKNOWN = "–"


def order_of_sector(start: float, stop: float, step: float, sweeps: int, pings: int) -> ScanOrder:
    """The scan of a sector in degrees, `stop` not included, whichever way it leads.

    Raises ValueError, in words for a person, where there is none or no scanner makes so many readings.
    """
    if stop == start:
        raise ValueError("the sector is empty: “to” is the angle where it ends")
    step = math.copysign(step, stop - start)
    order = ScanOrder(math.radians(start), math.radians(step), headings_between(start, stop, step), sweeps, pings)
    if microdegrees_of(order.step) == 0:
        raise ValueError("the step is too fine for the protocol")
    if order.readings > MOST_READINGS:
        raise ValueError(f"{order.readings} readings are more than the {MOST_READINGS} of one scan")
    return order


def scan_summary(order: ScanOrder, device: DeviceInfo | None) -> str:
    """How many readings a scan will make, and how long that takes at least, where the device has said."""
    told = f"{order.headings} headings, {order.readings} readings"
    capabilities = device.capabilities if device else None
    if capabilities is None or not capabilities.ping_period:
        return told
    return f"{told}, {_duration(order.readings * capabilities.ping_period)} or more"


def state_text(status: Status) -> str:
    """How it stands with the scanner, in a few words."""
    if not status.can_scan:
        return "No scanner chosen"
    if status.link is None:
        return "Connecting …" if status.scanning else "Not connected"
    if status.link.loss:
        return "Lost; it is looked for"
    if status.source is Source.REPLAY or status.phase is None or not status.scanning:
        return "Connected"
    return f"{str(status.phase).capitalize()} …"


def identity_text(link: LinkState | None) -> str:
    """Who answers, and where."""
    if link is None:
        return UNKNOWN
    device = link.device
    major, minor = device.protocol
    return f"{device.firmware}, no. {device.serial}\nprotocol {major}.{minor}, at {link.url}"


def link_figures(link: LinkState | None) -> list[tuple[str, str, str]]:
    """The books of the line: name, figure, and what it means."""
    books = link.statistics if link else None

    def count(*names: str) -> str:
        return f"{sum(getattr(books, name) for name in names):,}".replace(",", " ") if books else UNKNOWN

    round_trip = books.round_trip if books else None
    return [
        ("Frames in · out", f"{count('frames_received')} · {count('frames_sent')}", "undamaged frames, either way"),
        ("Lost", count("missing_frames"), "frames of the device that never came: gaps in its numbers"),
        ("Corrupt", count("rejected_blocks", "rejected_messages"), "damaged on the way, and thrown away"),
        ("Resent", count("resends", "repeated_commands"), "asked for again, by either side"),
        ("Measured again", count("lost_readings"), "readings that were lost and could not be sent again"),
        ("Times lost", count("losses"), "how often the scanner was gone: unplugged, silent or reset"),
        (
            "Round trip",
            UNKNOWN if round_trip is None else f"{round_trip * 1e3:.1f} ms",
            "from a question to its answer",
        ),
        ("Speed", f"{link.baud:,} baud".replace(",", " ") if link and link.baud else UNKNOWN, "– where it has none"),
        ("Clock drift", _drift(link), "host's clock against the device's; – where that is played at another pace"),
    ]


def _drift(link: LinkState | None) -> str:
    if link is None or abs(link.drift) >= MOST_DRIFT:
        return UNKNOWN
    return f"{link.drift * 1e6:+.0f} ppm"


def temperature_text(status: Status) -> str:
    """The air at the board."""
    return UNKNOWN if status.temperature_c is None else f"{status.temperature_c:.1f} °C"


def angle_text(angle: float | None) -> str:
    """Where the turntable points, as last told."""
    return UNKNOWN if angle is None else f"{math.degrees(angle):.1f}°"


def _duration(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
