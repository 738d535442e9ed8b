"""What has passed over a link: the numbers that show a bad cable.

Takes counts as things happen; hands on the books of one connection, or of several together.
"""

from dataclasses import dataclass, fields, replace

_SMOOTHED = 0.2  # share of the newest round trip in the usual one


@dataclass(frozen=True)
class LinkStatistics:
    """Books of a link."""

    frames_received: int = 0
    frames_sent: int = 0
    bytes_received: int = 0
    bytes_sent: int = 0
    rejected_blocks: int = 0  # stretches between delimiters that are no frame
    rejected_messages: int = 0  # undamaged frames whose payload does not have the shape of its type
    missing_frames: int = 0  # gaps in the device's sequence numbers
    repeated_commands: int = 0
    resends: int = 0  # Resend commands
    lost_readings: int = 0  # made, but no longer kept when they were asked for; they are measured again
    losses: int = 0  # times the device was lost: unplugged, silent or reset
    reopened: int = 0  # times its port had to be opened again
    resets: int = 0  # times the device started anew
    round_trip: float | None = None  # s from a question to its answer, smoothed

    def more(self, **counts: int) -> "LinkStatistics":
        """These books with so much more in them."""
        return replace(self, **{name: getattr(self, name) + count for name, count in counts.items()})

    def __add__(self, later: "LinkStatistics") -> "LinkStatistics":
        """The books of both together; the round trip is the later one's, where it has one."""
        counts = {
            item.name: getattr(self, item.name) + getattr(later, item.name)
            for item in fields(self)
            if item.name != "round_trip"
        }
        return LinkStatistics(**counts, round_trip=self.round_trip if later.round_trip is None else later.round_trip)


def smoothed(usual: float | None, newest: float) -> float:
    """The usual round trip, s, after one more."""
    return newest if usual is None else usual + _SMOOTHED * (newest - usual)
