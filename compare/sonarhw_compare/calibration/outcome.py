"""The outcome of a calibration: values with intervals, what stays and why, doubts, printed lines, JSON and profile."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import tomlkit
from sonarhw_sim.board.profile import Board, OwnBodyPart, parse_board
from tomlkit.exceptions import TOMLKitError

from sonarhw.errors import InputError, counted
from sonarhw_compare.edits import Z95, below_header, set_marked

if TYPE_CHECKING:
    from sonarhw_compare.calibration.plate_readings import FacedPlate


@dataclass(frozen=True)
class Measured:
    """A value with its standard deviation."""

    value: float
    deviation: float


@dataclass(frozen=True)
class CalibratedValue:
    """A value that a calibration has determined, with its 95 % interval."""

    key: str  # of the profile, or a material of the room
    value: float
    low: float
    high: float
    before: float
    unit: str
    decimals: int | None = None  # as written; None: those with which the interval has two significant digits
    mark: str = ""  # comment in the profile; empty: the interval

    @property
    def text(self) -> str:
        """The value as it is written."""
        return f"{self.value:z.{self._digits}f}"

    @property
    def interval_text(self) -> str:
        """The 95 % interval with the same decimals, and the unit."""
        return f"{self.low:z.{self._digits}f} to {self.high:z.{self._digits}f} {self.unit}".rstrip()

    @property
    def line(self) -> str:
        """The value, its interval and the former value in words."""
        return f"{self.key}: {self.text}, 95 % {self.interval_text}; before: {self.before:g}"

    @property
    def figures(self) -> dict[str, Any]:
        """The same, as for JSON."""
        numbers = {"value": float(self.text), "low": self.low, "high": self.high, "before": self.before}
        return {"key": self.key, **numbers, "unit": self.unit}

    @property
    def _digits(self) -> int:
        if self.decimals is not None:
            return self.decimals
        return max(0, 1 - math.floor(math.log10((self.high - self.low) / 2)))


@dataclass
class Calibration:
    """What a calibration has determined so far, beginning with the profile `start`."""

    start: Board
    board: Board  # with the values found
    findings: list[CalibratedValue] = field(default_factory=list)
    own_body: tuple[OwnBodyPart, ...] = ()  # found; empty if none, or if it stays
    kept: dict[str, str] = field(default_factory=dict)  # reason by key
    doubts: list[str] = field(default_factory=list)
    header: Sequence[str] = ()  # comments at the top of the profile; empty: those of `start`
    plate: "FacedPlate | None" = None  # that the scanner faces; None: another calibration

    def add(
        self, key: str, value: float, low: float, high: float, unit: str, decimals: int | None = None, mark: str = ""
    ) -> None:
        """Add a value with its 95 % interval."""
        # without `ring_cycles`, the ring-down is that of `rise_cycles`
        before = getattr(self.start, key)
        before = float(self.start.rise_cycles if before is None else before)
        self.findings.append(CalibratedValue(key, value, low, high, before, unit, decimals, mark))
        self.board = self.board.with_numbers({key: value})

    def add_measured(
        self, key: str, measured: Measured, unit: str, decimals: int | None = None, mark: str = ""
    ) -> None:
        """Add a value with its standard deviation."""
        half = Z95 * measured.deviation
        self.add(key, measured.value, measured.value - half, measured.value + half, unit, decimals, mark)

    def lines(self) -> list[str]:
        """Return what was found, and what stays and why, in words."""
        kept = [f"{key}: stays {_present(self.start, key)}; {reason}" for key, reason in self.kept.items()]
        plate = [] if self.plate is None else [self.plate.line]
        return [*plate, *(finding.line for finding in self.findings), *self.own_body_lines(), *kept]

    def own_body_lines(self) -> list[str]:
        """Return the parts of the own body in words."""
        return [
            f"own body: turntable angles {part.from_deg:g} to {part.to_deg:g} degrees, "
            f"{part.nearest:g} to {part.farthest:g} m"
            for part in self.own_body
        ]

    def figures(self) -> dict[str, Any]:
        """Return the same, as for JSON."""
        return {
            "board": self.start.name,
            "findings": [finding.figures for finding in self.findings],
            "own_body": [part.model_dump() for part in self.own_body],
            "kept": self.kept,
            "doubts": self.doubts,
            **({} if self.plate is None else {"plate": asdict(self.plate)}),
        }

    def profile(self, name: str) -> Board:
        """Return the profile `start` with another name and what was found; what stays is listed below its header.

        Comments state the 95 % intervals and the former values. Raises InputError if the text of the profile cannot be
        changed.
        """
        try:
            profile: Any = tomlkit.parse(self.start.text)
            profile["name"] = name
            for finding in self.findings:
                mark = finding.mark or f"calibrated, 95 % {finding.interval_text}"
                set_marked(profile, finding.key, float(finding.text), finding.before, mark)
            if self.own_body:
                profile["own_body"] = _tables(self.own_body)
            text = tomlkit.dumps(profile)
        except TOMLKitError as error:
            raise InputError(f"the board profile cannot be changed: {error}; choose another profile") from error
        if self.header:
            kept = (f"# Kept: {key}; {reason}." for key, reason in self.kept.items())
            text = below_header([*self.header, *kept], text, self.start.name)
        return parse_board(text, f"profile {name!r}")


def _present(start: Board, key: str) -> str:
    """Return the value of a key, such as `mount.ahead`, or the number of its parts."""
    section, _, name = key.rpartition(".")
    value = getattr(getattr(start, section) if section else start, name)
    return f"{value:g}" if isinstance(value, float) else counted(len(value), "part")


def _tables(own_body: Sequence[OwnBodyPart]) -> Any:
    parts = tomlkit.aot()
    for part in own_body:
        table = tomlkit.table()
        table.update(part.model_dump())
        parts.append(table)
    return parts
