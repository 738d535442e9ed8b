"""The contents of a log as frozen dataclasses, and the names used in the file."""

from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import version
from typing import Protocol

from sonarhw.harmless_text import counted
from sonarhw.lost_steps import lost_steps_clause, split_at_homings, unverified_clause
from sonarhw.readings import Origin, Reading
from sonarhw.wire.codes import Outcome
from sonarhw.wire.messages import Finished, Info, Settings
from sonarhw.wire.origin import origin_of

FORMAT_VERSION = 1
PROFILE = "sonarhw"  # of the MCAP header
METADATA_NAME = "sonarhw"  # of the MCAP metadata record

FRAMES_RECEIVED = "/frames/rx"
FRAMES_SENT = "/frames/tx"
READINGS = "/readings"
SWEEPS = "/scan"
BYTES = "/bytes/rx"  # as received from a device that sends no frames
TRACES = "/traces"  # decoded, for log viewers; never read back
# in the order of their channel numbers, from 1, so that a log without its channel records can be read
TOPICS = (FRAMES_RECEIVED, FRAMES_SENT, READINGS, SWEEPS, BYTES, TRACES)


@dataclass(frozen=True)
class LogMetadata:
    """The origin of a log; the first record of the file."""

    made_by: str  # "scan", "ping", "import", "simulate"; "unknown" if it is missing in a torn file
    started: float  # s since the epoch; 0 if it is missing in a torn file
    room_file: str = ""  # name of the room file, empty without one
    room_text: str = ""  # text of the room file when the log was made
    place: str = ""
    board: str = ""  # name of the board profile
    board_text: str = ""  # text of the board profile when the log was made
    product_version: str = version("sonarhw")
    format_version: int = FORMAT_VERSION


@dataclass(frozen=True)
class RecordedFrame:
    """One frame as it passed over the link."""

    time: float  # host clock, s since the epoch
    received: bool  # True: from the device; False: from the host
    wire: bytes  # with delimiter


class RecordedFrames(Protocol):
    """All frames of a log, in order. Each iteration reads them from the file."""

    def __len__(self) -> int:
        """Return the number of frames."""

    def __iter__(self) -> Iterator[RecordedFrame]:
        """Yield the frames. Raises NotALog if the file can no longer be read."""

    def pieces(self) -> Iterator[list[RecordedFrame]]:
        """Yield the frames in the groups in which they were written."""

    def received_bytes(self) -> Iterator[tuple[float, bytes]]:
        """Yield the bytes of a device that sends no frames, as received, and their time, s since the epoch."""


@dataclass(frozen=True)
class RecordedScan:
    """The readings from one Started to the next. An interrupted and continued scan is one scan."""

    began: float  # s on the clock of the readings
    expected: int | None  # readings announced by Started; None if the log does not contain it
    settings: Settings | None
    readings: tuple[Reading, ...]  # by number; their traces are read from the file on access
    finished: Finished | None  # None if the log ends before the scan
    homed: tuple[float, ...] = ()  # times of homings during the scan, s on the clock of the readings

    @property
    def made(self) -> int:
        """The number of readings that the device made: those announced, unless the scan was stopped."""
        return self.finished.readings if self.finished else self.expected or 0

    @property
    def missing(self) -> int:
        """The number of readings that the device made but the log does not contain."""
        return max(0, self.made - len(self.readings))

    @property
    def angle_warning(self) -> str | None:
        """Clause with the angles that may be wrong, and the reason; None if there are none."""
        slipped = self.finished is not None and self.finished.outcome == Outcome.LOST_STEPS
        if not slipped and not self.homed:
            return None
        runs = split_at_homings(
            [reading.time for reading in self.readings], [reading.angle for reading in self.readings], self.homed
        )
        of_last = lost_steps_clause(runs) if slipped else None
        lost = of_last and f"the turntable lost steps; {of_last}"
        return "; ".join(filter(None, (lost, unverified_clause(runs)))) or None


@dataclass(frozen=True)
class Log:
    """The contents of a log."""

    metadata: LogMetadata
    info: Info | None  # of the last greeting
    settings: Settings | None  # the last in force
    frames: RecordedFrames
    scans: tuple[RecordedScan, ...]
    torn: str | None  # clause that states where the file is incomplete or damaged; None: the file is whole
    damaged: bool  # whether it is damaged before its end

    @property
    def origin(self) -> Origin:
        """The origin of the readings: measured, or fake, simulated or imported."""
        device = self.info
        return origin_of(self.metadata.made_by, device.firmware if device else "", device.serial if device else "")

    @property
    def condition(self) -> str:
        """`whole`, `torn` or `damaged`."""
        return "damaged" if self.damaged else "torn" if self.torn else "whole"

    @property
    def doubts(self) -> tuple[str, ...]:
        """Clauses for warnings: what is missing in the file and what to do, and which angles may be wrong."""
        count = len(self.readings)
        remedy = "; to repair it: `sonarhw log recover LOG --out FILE.mcap`" if count else ""
        missing = (f"{self.condition}; {counted(count, 'whole reading')} read; {self.torn}{remedy}",) * bool(self.torn)
        several = len(self.scans) > 1
        doubted = ((number, scan.angle_warning) for number, scan in enumerate(self.scans, 1))
        return missing + tuple(f"scan {number}: {why}" if several else why for number, why in doubted if why)

    @property
    def readings(self) -> tuple[Reading, ...]:
        """The readings of all scans, one scan after the other."""
        if len(self.scans) == 1:
            return self.scans[0].readings
        return tuple(reading for scan in self.scans for reading in scan.readings)
