"""What a log holds: the values that the writer takes and the reader gives, and the names inside the file.

Takes nothing, hands on frozen dataclasses; bytes and files are in log_writer and log_reader.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import version
from typing import Protocol

from sonarhw.lost_steps import lost_steps_clause, split_at_homings, unverified_clause
from sonarhw.readings import Reading
from sonarhw.wire.messages import Finished, Info, Outcome, Settings

FORMAT_VERSION = 1
PROFILE = "sonarhw"  # of the MCAP header
METADATA_NAME = "sonarhw"  # of the MCAP metadata record

FRAMES_RECEIVED = "/frames/rx"
FRAMES_SENT = "/frames/tx"
READINGS = "/readings"
SWEEPS = "/scan"
# in the order in which they are registered, from 1 on: where the record that says so is lost, this still holds
TOPICS = (FRAMES_RECEIVED, FRAMES_SENT, READINGS, SWEEPS)


@dataclass(frozen=True)
class LogMetadata:
    """Where a log comes from; stands at the beginning of the file."""

    made_by: str  # "scan", "import", "simulate"; "unknown" where a torn file ends before it
    started: float  # s since the epoch; 0 where a torn file ends before it
    room_file: str = ""  # name of the room file, empty where none was given
    room_text: str = ""  # the room file's text as it was then
    place: str = ""
    board: str = ""  # name of the board profile
    board_text: str = ""  # the board profile's text as it was then
    product_version: str = version("sonarhw")
    format_version: int = FORMAT_VERSION


@dataclass(frozen=True)
class RecordedFrame:
    """One frame as it passed over the link."""

    time: float  # host clock, s since the epoch
    received: bool  # True: from the device; False: from the host
    wire: bytes  # with delimiter


class RecordedFrames(Protocol):
    """All frames of a log, in order; they stay in the file, and every iteration reads them from there."""

    def __len__(self) -> int:
        """How many there are."""

    def __iter__(self) -> Iterator[RecordedFrame]:
        """One after the other. Raises NotALog where the file can no longer be read."""

    def pieces(self) -> Iterator[list[RecordedFrame]]:
        """The same, those together that were written together."""


@dataclass(frozen=True)
class RecordedScan:
    """The readings from one Started to the next; a scan that broke and went on is one."""

    began: float  # s on the clock of the readings
    expected: int | None  # readings announced by Started; None where the log does not hold it
    settings: Settings | None
    readings: tuple[Reading, ...]  # by number; their traces stay in the file until they are looked at
    finished: Finished | None  # None where the log ends before the scan does
    homed: tuple[float, ...] = ()  # when the zero was sought anew in mid-scan, s on the clock of the readings

    @property
    def angle_warning(self) -> str | None:
        """Which readings may stand at wrong angles, and why; None where that is not known of any."""
        slipped = self.finished is not None and self.finished.outcome == Outcome.LOST_STEPS
        if not slipped and not self.homed:
            return None
        apart = split_at_homings(
            [reading.time for reading in self.readings], [reading.angle for reading in self.readings], self.homed
        )
        of_last = lost_steps_clause(apart) if slipped else None
        told = of_last and f"the turntable lost steps; {of_last}"
        return "; ".join(filter(None, (told, unverified_clause(apart)))) or None


@dataclass(frozen=True)
class Log:
    """A log as it was read."""

    metadata: LogMetadata
    info: Info | None  # the last one, where the device was greeted more than once
    settings: Settings | None  # the last in force
    frames: RecordedFrames
    scans: tuple[RecordedScan, ...]
    torn: str | None  # where the file ends too early or is damaged, as a clause; None: it is whole
    damaged: bool = False  # not at its end alone

    @property
    def condition(self) -> str:
        """The word for it: whole, torn or damaged."""
        return "damaged" if self.damaged else "torn" if self.torn else "whole"

    @property
    def readings(self) -> tuple[Reading, ...]:
        """The readings of all scans, one scan after the other."""
        if len(self.scans) == 1:
            return self.scans[0].readings
        return tuple(reading for scan in self.scans for reading in scan.readings)
