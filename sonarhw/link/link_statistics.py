"""Counters of the traffic over a link. They show a bad cable."""

from dataclasses import dataclass, fields, replace

_SMOOTHED = 0.2  # weight of the newest round trip in the average


@dataclass(frozen=True)
class LinkStatistics:
    """Counters of the traffic over one connection or several."""

    frames_received: int = 0
    frames_sent: int = 0
    bytes_received: int = 0
    bytes_sent: int = 0
    rejected_blocks: int = 0  # blocks between delimiters that are not a valid frame
    rejected_messages: int = 0  # undamaged frames with a payload that does not match the message type
    missing_frames: int = 0  # gaps in the device's sequence numbers
    repeated_commands: int = 0
    resends: int = 0  # Resend commands
    lost_readings: int = 0  # readings that the device no longer kept for a Resend; they are measured again
    losses: int = 0  # times the device was lost: unplugged, silent or reset
    reopened: int = 0  # times the port was opened again
    resets: int = 0  # times the device restarted
    round_trip: float | None = None  # s from a command to its answer, smoothed

    def more(self, **counts: int) -> "LinkStatistics":
        """Return a copy with `counts` added."""
        return replace(self, **{name: getattr(self, name) + count for name, count in counts.items()})

    def __add__(self, later: "LinkStatistics") -> "LinkStatistics":
        """Return the sum of both. The round trip is that of `later`, if it has one."""
        counts = {
            item.name: getattr(self, item.name) + getattr(later, item.name)
            for item in fields(self)
            if item.name != "round_trip"
        }
        return LinkStatistics(**counts, round_trip=self.round_trip if later.round_trip is None else later.round_trip)


def smoothed(average: float | None, newest: float) -> float:
    """Return the smoothed round trip, s, after one more measurement."""
    return newest if average is None else average + _SMOOTHED * (newest - average)
