"""The calibration of a board from scans of a known room: values, intervals, what stays and why.

First the carrier's own body, then geometry and reflectances, then threshold and aperture by the rule for echoes and
silence, then the spreads of threshold and range. `calibrate_in_room` returns a profile that belongs to the room as it
is, `calibrate_board_and_room` one that belongs to the room with the reflectances found.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from sonarhw_sim.board.profile import Board, OwnBodyPart
from sonarhw_sim.room.room import Place, Room

from sonarhw.errors import InputError, counted, harmless
from sonarhw_compare.fit.values.fit_result import PlacedScan, Progress
from sonarhw_compare.fit.values.given_twice import check_given_once
from sonarhw_compare.known_room.detection_rule import Between, choose_detection
from sonarhw_compare.known_room.found_reflectances import (
    gained_by_reflection,
    reflectance_text,
    reflectances_of,
    with_reflectances,
)
from sonarhw_compare.known_room.own_body_search import ScanAtPlace, find_own_body, place_numbers
from sonarhw_compare.known_room.starting_turntable import StartingTurntable, starting_turntable
from sonarhw_compare.known_room.turntable_fit import (
    SharedValue,
    TurntableFit,
    fit_turntable,
    readings_per_independent,
    spreads,
)
from sonarhw_compare.matching.match import Comparison, Kind, compare_readings
from sonarhw_compare.profile_edit import Z95, CalibratedValue, calibrated_profile

_UNITS = {"range_offset": "m", "clock_error": "", "turntable_scale": "", "axis_x": "m", "axis_y": "m"}
# standard deviations: 95 % confidence in the five values of the geometry together (Bonferroni's inequality), so that
# none of five changes by chance alone
_CONTRADICTED = 2.58
_SAME_ZERO = math.radians(10.0)  # most difference of the zero between logs, up to which it belongs to the board
_FEWEST_SCANS = 3  # for the rule to be sure
_LONE_RUN = 3  # neighbouring readings, at least, that are proposed as own body if there is only one place


@dataclass(frozen=True)
class ScanFigures:
    """How well a profile explains one scan at its pose: echoes within 5 cm, and silence."""

    comparison: Comparison

    @property
    def line(self) -> str:
        """The figures in words."""
        summary = self.comparison.summary()
        share = "no echo" if summary.within_5cm is None else f"{summary.within_5cm:.0%} of the echoes within 5 cm"
        agreement = summary.no_echo_agreement
        return share if agreement is None else f"{share}, balanced accuracy of silence {agreement:.3f}"


@dataclass(frozen=True)
class RoomCalibration:
    """The result: what was found, what stays as it was and why, doubts, and the scans before and after."""

    board: Board  # with the values found
    room: Room  # to which the profile belongs: the given one, or with the reflectances found
    reflectances: tuple[CalibratedValue, ...]  # of the materials, by these scans
    room_is_changed: bool  # whether the room has these reflectances
    findings: tuple[CalibratedValue, ...]
    own_body: tuple[OwnBodyPart, ...]  # found; empty if none, or if it stays
    own_echoes: int  # readings of the own body
    kept: dict[str, str]  # reason by key
    proposals: tuple[str, ...]  # own body that one place cannot prove
    doubts: tuple[str, ...]
    before: tuple[ScanFigures, ...]
    after: tuple[ScanFigures, ...]


@dataclass(frozen=True)
class _Begun:
    """A calibration after the searches that need no decision on the reflectances."""

    start: Board
    scans: Sequence[PlacedScan]
    room: Room  # the given one
    first: StartingTurntable
    before: tuple[ScanFigures, ...]
    fitted: TurntableFit
    result: "_Result"

    @property
    def reflectances(self) -> tuple[CalibratedValue, ...]:
        """Those of the materials, by the scans."""
        return reflectances_of(self.room, self.fitted)


def calibrate_in_room(
    start: Board, scans: Sequence[PlacedScan], room: Room, progress: Progress = lambda _share, _doing: None
) -> RoomCalibration:
    """Return the calibration of a board from scans of a known room, beginning with the profile `start`.

    The place of each scan is right within some 3 cm. Headings of the places are searched in the full circle. Raises
    InputError for a ring of sensors, a scan without an echo, or a scan that is given twice.
    """
    _check(start, scans)
    return _finished(_begun(start, scans, room, progress), room, progress)


def calibrate_board_and_room(
    start: Board, scans: Sequence[PlacedScan], room: Room, progress: Progress = lambda _share, _doing: None
) -> RoomCalibration:
    """Return the calibration of a board, as `calibrate_in_room` does, and of the reflectances of the room.

    Raises InputError as `calibrate_in_room` does, and if the scans have no silence, or the room has no reflectance to
    find.
    """
    _check(start, scans)
    if all(reading.range is not None for scan in scans for reading in scan.readings):
        raise InputError("the logs have no silence, so they determine no reflectance; calibrate the board only")
    begun = _begun(start, scans, room, progress)
    return _finished(begun, _reflecting_as_found(begun.result, room, begun.reflectances), progress)


def _begun(start: Board, scans: Sequence[PlacedScan], room: Room, progress: Progress) -> _Begun:
    """Find headings, the carrier's own body, geometry and reflectances."""
    progress(0.0, "searching headings")
    first = starting_turntable(scans, room, start, lambda share: progress(0.25 * share, "searching headings"))
    before = _compared(scans, room, start, replace(first, scale=start.turntable_scale))
    result = _Result(replace(start, turntable_scale=first.scale))
    _find_own_body(result, scans, room, first, start)
    searches = iter(range(1000))
    fitted = fit_turntable(
        scans, room, result.board, first, lambda: progress(min(0.25 + 0.06 * next(searches), 0.5), "fitting geometry")
    )
    return _Begun(start, scans, room, first, before, fitted, result)


def _finished(begun: _Begun, room: Room, progress: Progress) -> RoomCalibration:
    """Return the calibration for `room`: the given one, or with the reflectances found."""
    result, scans, start = begun.result, begun.scans, begun.start
    _find_geometry(result, begun.fitted, start)
    _find_home(result, scans, begun.fitted, start)
    places = begun.fitted.places
    _find_detection(
        result,
        scans,
        room,
        places,
        start,
        lambda share: progress(0.5 + 0.35 * share, "choosing threshold and aperture"),
    )
    _find_spreads(result, scans, room, places, start, lambda: progress(0.87, "finding spreads"))
    progress(0.93, "comparing")
    after = _compared(scans, room, result.board, replace(begun.first, scale=result.board.turntable_scale))
    progress(1.0, "comparing")
    return RoomCalibration(
        board=result.board,
        room=room,
        reflectances=begun.reflectances,
        room_is_changed=room is not begun.room,
        findings=tuple(result.findings),
        own_body=result.own_body,
        own_echoes=sum(row.kind is Kind.OWN_BODY for one in after for row in one.comparison.rows),
        kept=result.kept,
        proposals=tuple(result.proposals),
        doubts=_doubts(scans),
        before=begun.before,
        after=after,
    )


def room_profile(start: Board, found: RoomCalibration, scans: Sequence[PlacedScan], room: str, name: str) -> Board:
    """Return the profile `start` with another name and what was found. Its header names the scans and the `room`.

    Raises InputError if the text of the profile cannot be changed.
    """
    keys = [finding.key for finding in found.findings] + (["own_body"] if found.own_body else [])
    which = "with these reflectances" if found.room_is_changed else "as in its file"
    header = [
        f"# Calibrated by `sonarhw calibrate` in room {harmless(room)!r}, beginning with profile {start.name!r}: "
        f"{', '.join(keys)}.",
        "# Threshold and aperture: most echoes within 5 cm, counted three times, and silence, counted once.",
        "# Spreads are those of readings, as they are in the logs.",
        f"# The profile belongs to the room {which}. The scans give:",
        *(f"#   {reflectance_text(one)}" for one in found.reflectances),
    ]
    for scan, after in zip(scans, found.after, strict=True):
        x, y = scan.place.position
        header.append(f"#   {harmless(scan.title)}: at {x:g}, {y:g} m; {after.line}")
    return calibrated_profile(start, name, header, found.findings, found.kept, found.own_body)


def _check(start: Board, scans: Sequence[PlacedScan]) -> None:
    """Raise InputError if no calibration is possible with this board and these scans."""
    if start.ring is not None:
        raise InputError(f"board {start.name!r} is a ring of sensors and has no turntable to calibrate")
    check_given_once(scans)
    for scan in scans:
        if all(reading.range is None for reading in scan.readings):
            raise InputError(f"{scan.title}: no reading has an echo; it cannot calibrate a board")


class _Result:
    """The result so far."""

    def __init__(self, board: Board) -> None:
        self.board = board
        self.findings: list[CalibratedValue] = []
        self.own_body: tuple[OwnBodyPart, ...] = ()
        self.kept: dict[str, str] = {}
        self.proposals: list[str] = []

    def add(self, key: str, found: Between, before: float, unit: str) -> None:
        """Add a value with its 95 % interval."""
        self.findings.append(CalibratedValue(key, found.value, found.low, found.high, before, unit))
        self.board = self.board.with_numbers({key: found.value})

    def add_measured(self, key: str, found: SharedValue, before: float, unit: str) -> None:
        """Add a value with its standard deviation."""
        half = Z95 * found.deviation
        self.add(key, Between(found.value, found.value - half, found.value + half), before, unit)


def _compared(
    scans: Sequence[PlacedScan], room: Room, board: Board, first: StartingTurntable
) -> tuple[ScanFigures, ...]:
    """Return each scan beside its prediction, with heading, offset and position within 3 cm as fit it best."""
    from sonarhw_compare.fit.plain_fit import fit_scan

    figures = []
    for scan in scans:
        fit = fit_scan(scan.readings, room, scan.place, board, frozenset({"heading", "offset", "position"}))
        figures.append(ScanFigures(compare_readings(scan.readings, room, fit.place, board, offset=fit.offset)))
    return tuple(figures)


def _find_own_body(
    result: _Result, scans: Sequence[PlacedScan], room: Room, first: StartingTurntable, start: Board
) -> None:
    """Find the carrier's body among the echoes that the room does not explain, and apply it."""
    board = replace(start, own_body=(), turntable_scale=first.scale)
    compared = [
        compare_readings(scan.readings, room, place, board) for scan, place in zip(scans, first.places, strict=True)
    ]
    positions = [scan.place.position for scan in scans]
    if place_numbers(positions).max() == 0:
        result.kept["own_body"] = "all logs are from one place; scan from another place"
        result.proposals += _lone_runs(compared)
        return
    unexplained = [[row.reading for row in one.rows if row.path is None] for one in compared]
    result.own_body = find_own_body([ScanAtPlace(*both) for both in zip(unexplained, positions, strict=True)])
    if result.own_body:
        result.board = replace(result.board, own_body=result.own_body)
    elif start.own_body:
        result.kept["own_body"] = "no other echoes have the same turntable angle and range at all places"


def _lone_runs(compared: Sequence[Comparison]) -> list[str]:
    """Return runs of echoes that are nearer than all that the room can give, of the first scan, in words."""
    rows = [row for row in compared[0].rows if row.kind in (Kind.SHORT, Kind.EXTRA) and row.path is None]
    nearest = float(np.nanmin(compared[0].prediction.ranges, initial=math.inf))
    near = [row for row in rows if row.measured is not None and row.measured < nearest]
    runs: list[list[int]] = []
    for row in near:
        if runs and row.index == runs[-1][-1] + 1:
            runs[-1].append(row.index)
        else:
            runs.append([row.index])
    lines = []
    for run in runs:
        if len(run) >= _LONE_RUN:
            angles = [math.degrees(compared[0].rows[k].reading.angle) for k in run]
            ranges = [compared[0].rows[k].reading.range or 0.0 for k in run]
            lines.append(
                f"echoes at turntable angles {min(angles):.0f} to {max(angles):.0f} degrees, {min(ranges):.2f} to "
                f"{max(ranges):.2f} m, are nearer than anything in the room: perhaps own body; scan from another place"
            )
    return lines


def _reflecting_as_found(result: _Result, room: Room, found: Sequence[CalibratedValue]) -> Room:
    """Return the room with the reflectances found, and move the threshold with the level of one reflection.

    This level is what profile and room file state together. It stays until the scans contradict it, by the rule for
    threshold and aperture. Echoes with more reflections determine the reflectances.
    """
    changed = with_reflectances(room, found)
    moved = result.board.threshold_db + gained_by_reflection(room, changed)
    result.board = replace(result.board, threshold_db=min(moved, 0.0))
    return changed


def _find_geometry(result: _Result, fitted: TurntableFit, start: Board) -> None:
    """Add what the scans show to be other than before; the rest stays."""
    for key, unit in _UNITS.items():
        found, before = fitted.shared[key], float(getattr(start, key))
        if abs(found.value - before) > _CONTRADICTED * found.deviation:
            result.add_measured(key, found, before, unit)
        else:
            half = f"{found.value:.2g} ± {_CONTRADICTED * found.deviation:.2g} {unit}".rstrip()
            result.kept[key] = f"the scans do not contradict it (99 %: {half})"
            result.board = result.board.with_numbers({key: before})
    result.kept["mount.ahead"] = "only its sum with range_offset shows in a room; measure it with a ruler"


def _find_home(result: _Result, scans: Sequence[PlacedScan], fitted: TurntableFit, start: Board) -> None:
    """Add the direction of the zero, if it is the same in all logs."""
    turns = np.array(
        [
            math.remainder(place.heading - scan.place.heading, math.tau)
            for scan, place in zip(scans, fitted.places, strict=True)
        ]
    )
    middle = float(np.angle(np.exp(1j * turns).mean()))
    away = np.angle(np.exp(1j * (turns - middle)))
    if np.abs(away).max() > _SAME_ZERO:
        result.kept["home_angle_deg"] = (
            f"the zero differs by up to {math.degrees(float(np.ptp(away))):.0f} degrees between the logs; "
            "give the heading of each place"
        )
        return
    # at least the uncertainty of one heading
    spread = max(float(np.std(away, ddof=1)) if len(away) > 1 else 0.0, math.radians(1.0)) / math.sqrt(len(away))
    degrees = SharedValue(math.degrees(middle), math.degrees(spread))
    result.add_measured("home_angle_deg", degrees, start.home_angle_deg, "degrees")


def _find_detection(
    result: _Result,
    scans: Sequence[PlacedScan],
    room: Room,
    places: Sequence[Place],
    start: Board,
    tick: Callable[[float], None],
) -> None:
    """Add threshold and aperture by the rule for echoes and silence; a threshold that no silence bounds stays."""
    redundancy = float(np.mean([readings_per_independent(scan, result.board) for scan in scans]))
    chosen = choose_detection(scans, room, result.board, places, redundancy, tick)
    if chosen.is_determined:
        result.add("threshold_db", chosen.threshold_db, start.threshold_db, "dB")
    else:
        result.kept["threshold_db"] = "the logs have no silence, or no echo"
    result.add("aperture_radius", chosen.aperture_radius, start.aperture_radius, "m")


def _find_spreads(
    result: _Result,
    scans: Sequence[PlacedScan],
    room: Room,
    places: Sequence[Place],
    start: Board,
    tick: Callable[[], None],
) -> None:
    """Add the standard deviations of range and threshold; one that the profile states stays until contradicted."""
    of_range, of_threshold = spreads(scans, room, result.board, places, tick)
    for key, found, unit in (("threshold_sd_db", of_threshold, "dB"), ("range_sd", of_range, "m")):
        low, high = max(found.value - Z95 * found.deviation, 0.0), found.value + Z95 * found.deviation
        before = float(getattr(start, key))
        # the spread of a population holds until the scans contradict it; 0 states none
        if before and low <= before <= high:
            result.kept[key] = f"the 95 % interval of the scans, {low:.2g} to {high:.2g} {unit}, contains it"
        else:
            result.add(key, Between(found.value, low, high), before, unit)


def _doubts(scans: Sequence[PlacedScan]) -> tuple[str, ...]:
    if len(scans) >= _FEWEST_SCANS:
        return ()
    return (
        f"{counted(len(scans), 'scan')}: values may be those of this place alone; "
        f"expected at least {_FEWEST_SCANS} places",
    )
