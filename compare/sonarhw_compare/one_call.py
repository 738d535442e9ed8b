"""The tasks of `sonarhw` in one call each: compare, fit, locate, map, calibrate and report.

Command line and Python programs call the same functions. Scans are logs, their files, or readings. Room, place and
board are objects, names or files; by default those in the log. A result has its `lines`, its `figures` for JSON and its
`doubts`. `warn` receives warnings about the input at once; by default they are Python warnings.
"""

import math
import numbers
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias, cast

import numpy as np
from sonarhw_sim.air import DEFAULT_BOARD, ROOM_TOLERANCE, Air, Model, Receiver
from sonarhw_sim.board.profile import Board, load_board, parse_board, without_own_body
from sonarhw_sim.room.room import Place, Room, place_at, typed_place, warn_of_place, warn_of_poses

from sonarhw import arguments
from sonarhw.arguments import Warn, emit
from sonarhw.errors import InputError, counted
from sonarhw.files import atomic_file
from sonarhw.host.scanner import Scanner
from sonarhw.log import Log, LogMetadata
from sonarhw.readings import Reading, ScanOrder, sector
from sonarhw.sound_speed import ScanAir
from sonarhw.wire.messages import seconds_of
from sonarhw_compare.rooms.effort import Effort
from sonarhw_compare.scanner_url import check_turns, open_scanner
from sonarhw_compare.scans import (
    BoardInput,
    GivenScan,
    PlaceInput,
    RoomInput,
    ScanInput,
    common_board,
    given_scan,
    is_pair,
)

if TYPE_CHECKING:
    from sonarhw_sim.predict.prediction import PredictionOptions

    from sonarhw_compare.calibration.outcome import Calibration
    from sonarhw_compare.explain import ScanComparison
    from sonarhw_compare.fit.fitting import FittedScans
    from sonarhw_compare.fit.result import PlacedScan, Progress
    from sonarhw_compare.fit.starting import Fit
    from sonarhw_compare.locate import Located, PoseSpread
    from sonarhw_compare.map import RoomMap
    from sonarhw_compare.report import Report
    from sonarhw_compare.rooms.causes import FoundCauses
    from sonarhw_compare.rooms.outcome import MappedScans, RoomOfScans
    from sonarhw_compare.track import Track
    from sonarhw_compare.two_scans import HeadingSeries, ScanDifference

_APART = 0.02  # m, between places that count as one
_HALF_SECTOR, _SECTOR_STEP, _SECTOR_PINGS = 30.0, 0.5, 3  # degrees, of the scan of a plate

Tick: TypeAlias = Callable[[float], None]  # receives the completed share, 0..1


def _silent(_share: float, _step: str = "") -> None:
    """Ignore progress."""


# the arguments that several tasks have
_ROOM = arguments.instance((Room, Path, str), "a room, its name or its file; `room_from_arrays` makes one of arrays")
_BOARD = arguments.instance((Board, Path, str), "a board, its name or its file")
_MODEL, _RECEIVER = arguments.choice(Model), arguments.choice(Receiver, or_none=True)
_TOLERANCE = arguments.number(0, unit="m")


def _comparison(name: str, value: object) -> object:
    """Check the result of `compare`."""
    from sonarhw_compare.explain import ScanComparison

    return arguments.instance(ScanComparison, "the result of `compare`")(name, value)


def _prediction_options(name: str, value: object) -> object:
    """Check the options of a prediction."""
    from sonarhw_sim.predict.prediction import PredictionOptions

    return arguments.instance(PredictionOptions, "a PredictionOptions")(name, value)


def _numbers_of_scans(name: str, value: object) -> list[float]:
    """Check one number, or one for each scan."""
    read = np.atleast_1d(arguments.numbers_in(name, value, "a number, or one for each scan"))
    if read.ndim != 1 or not np.isfinite(read).all():
        raise arguments.refusal(name, "a finite number, or one for each scan", value)
    return [float(number) for number in read]


def _sweeps(name: str, value: object) -> object:
    """Check two numbers of sweeps, from 1, or None."""
    if not isinstance(value, tuple | list) or len(value) != 2:
        raise arguments.refusal(name, "two numbers of sweeps, or None", value)
    return tuple(None if sweep is None else arguments.whole(1)(name, sweep) for sweep in value)


@arguments.checked(
    room=_ROOM,
    board=_BOARD,
    fit=arguments.words,
    model=_MODEL,
    receiver=_RECEIVER,
    pings=arguments.whole(1),
    room_tolerance=_TOLERANCE,
    progress=arguments.function,
    warn=arguments.function,
)
def compare(
    scan: ScanInput,
    room: RoomInput | None = None,
    place: PlaceInput | None = None,
    board: BoardInput | None = None,
    *,
    fit: str | Iterable[str] = "",
    model: Model = Model.RAY_FOLLOWING,
    receiver: Receiver | None = None,
    pings: int = 1,
    room_tolerance: float = ROOM_TOLERANCE,
    progress: Tick = _silent,
    warn: Warn = emit,
) -> "ScanComparison":
    """Return each reading of a scan beside its prediction.

    `scan` is a log, its file, or readings. Room, place and board are objects, names or files; by default those in the
    log, and for readings the only place of the room and the default board. Readings of a sensor that moves are
    predicted from their poses; with a place, the first is there, and the others move with it. `fit` names quantities to
    fit first, such as "heading,offset,position"; the position within 3 cm. The default `receiver` is that of the board
    profile. The probabilities are those of medians of `pings`, with walls that are off by `room_tolerance` (m, standard
    deviation). `progress` receives the completed share of the fit, 0..1. Raises InputError. Warns if a log is damaged
    or names no board, if the place is outside the room, or if few echoes are explained.
    """
    from sonarhw_sim.predict.prediction import PredictionOptions
    from sonarhw_sim.predict.probability import check_pings

    from sonarhw_compare.corrections import agreement_doubts
    from sonarhw_compare.explain import ScanComparison
    from sonarhw_compare.match import match_readings, predicted_for

    check_pings(pings)
    given, in_room, placed, profile = _placed(scan, room, place, board, warn)
    options, offset = PredictionOptions(receiver=receiver), 0.0
    fitted = _fitted(fit, given, in_room, placed, profile, options, progress, model)
    where: Place | list[Place] = _faced(profile, given.places(placed) or placed)
    if fitted is not None:
        where, offset = fitted.place, fitted.offset
    prediction = predicted_for(given.readings, in_room, where, profile, options, model)
    matched = match_readings(given.readings, prediction, offset)
    for doubt in agreement_doubts(given.where, matched, model):
        warn(doubt)
    return ScanComparison(
        **vars(replace(matched, origin=given.origin)),
        fit=fitted,
        model=model,
        options=options,
        pings=pings,
        room_tolerance=room_tolerance,
    )


@arguments.checked(comparison=_comparison, progress=arguments.function)
def find_missing(comparison: "ScanComparison", progress: Tick = _silent) -> "FoundCauses":
    """Return the changes of the room that explain the misfits of a comparison. Raises InputError."""
    from sonarhw_compare.rooms.causes import find_causes

    prediction = comparison.prediction
    if prediction.poses is not None:
        raise InputError("comparison: the sensor moves; changes of the room are found from one place; compare a part")
    receiver, board = comparison.options.receiver, prediction.board
    # the comparison adds its offset to measured ranges; the place of a room file does not contain the board's zero
    board = replace(board, range_offset=board.range_offset - comparison.offset, receiver=receiver or board.receiver)
    place = replace(prediction.place, heading=comparison.heading - board.heading_at(0.0, 0.0))
    return find_causes(comparison.readings, prediction.room, place, board, progress)


@arguments.checked(sweeps=_sweeps, warn=arguments.function)
def compare_scans(
    first: ScanInput,
    second: ScanInput | None = None,
    *,
    sweeps: tuple[int | None, int | None] = (None, None),
    warn: Warn = emit,
) -> "ScanDifference":
    """Return the differences of two scans by heading, or of two `sweeps` (from 1) of one scan. No room is needed.

    Headings are those in the room, or turntable angles if a log contains no place. Raises InputError. Warns if the logs
    contain different rooms or places.
    """
    from sonarhw_compare.two_scans import scan_difference

    given = given_scan(first, warn)
    pair = given, given if second is None else given_scan(second, warn)
    rooms = [scan.recorded_room for scan in pair]
    names = [room.name for room in rooms if room is not None]
    if len(set(names)) > 1:
        warn(f"the logs contain different rooms, {names[0]!r} and {names[1]!r}; differences show this, too")
    places = [
        place
        for scan, room in zip(pair, rooms, strict=True)
        if (place := scan.pose if room is None else _recorded_place(scan, room))
    ]
    if len(places) < 2:
        headings = [0.0, 0.0]
    else:
        headings = [place.heading for place in places]
        distance = math.dist(places[0].position, places[1].position)
        if distance > _APART:
            warn(f"the places of the scans are {distance:.2f} m apart; differences by heading show this, too")
    series = [_series(*given) for given in zip(pair, headings, sweeps, strict=True)]
    return replace(scan_difference(series[0], series[1]), names=_names(pair, sweeps))


def _recorded_place(scan: GivenScan, room: Room) -> Place | None:
    place = scan.recorded_place(room)
    return None if place is None else room.place(place)


def _series(scan: GivenScan, heading: float, sweep: int | None) -> "HeadingSeries":
    from sonarhw_compare.two_scans import heading_series

    readings = [reading for reading in scan.readings if sweep is None or reading.sweep == sweep - 1]
    if not readings:
        last = max(reading.sweep for reading in scan.readings) + 1
        raise InputError(f"{scan.where}: has no sweep {sweep}; its sweeps: 1 to {last}")
    return heading_series(readings, scan.board(), heading)


def _names(scans: tuple[GivenScan, GivenScan], sweeps: tuple[int | None, int | None]) -> tuple[str, str]:
    """Return the names of the scans for lines and legends."""
    first, second = (Path(scan.where) for scan in scans)
    same_name = first != second and first.name == second.name
    one, other = (
        f"{file if same_name else file.name}{'' if sweep is None else f', sweep {sweep}'}"
        for file, sweep in zip((first, second), sweeps, strict=True)
    )
    return one, other


@arguments.checked(
    room=_ROOM,
    board=_BOARD,
    fit=arguments.words,
    receiver=_RECEIVER,
    progress=arguments.function,
    warn=arguments.function,
)
def report(
    scan: ScanInput,
    room: RoomInput | None = None,
    place: PlaceInput | None = None,
    board: BoardInput | None = None,
    *,
    fit: str | Iterable[str] = "",
    receiver: Receiver | None = None,
    progress: Tick = _silent,
    warn: Warn = emit,
) -> "Report":
    """Return a report about a scan: pictures, a summary, notes beside the log, every reading and the settings.

    Arguments and warnings are those of `compare`. Raises InputError.
    """
    from sonarhw_sim.predict.prediction import PredictionOptions

    from sonarhw_compare.corrections import agreement_doubts
    from sonarhw_compare.report import report_of

    given, in_room, placed, profile = _placed(scan, room, place, board, warn)
    notes = given.notes
    for doubt in notes.doubts:
        warn(doubt)
    options = PredictionOptions(receiver=receiver)
    fitted = _fitted(fit, given, in_room, placed, profile, options, progress)
    named = replace(given, where=Path(given.where).name)
    made = report_of(named, in_room, placed, profile, options, fit=fitted, notes=notes.texts)
    for doubt in agreement_doubts(given.where, made.comparison):
        warn(doubt)
    return made


@arguments.checked(
    path=arguments.file_name,
    room=_ROOM,
    board=_BOARD,
    fit=arguments.words,
    receiver=_RECEIVER,
    overwrite=arguments.flag,
)
def write_report(
    scan: ScanInput,
    path: Path | str,
    room: RoomInput | None = None,
    place: PlaceInput | None = None,
    board: BoardInput | None = None,
    *,
    fit: str | Iterable[str] = "",
    receiver: Receiver | None = None,
    overwrite: bool = False,
) -> None:
    """Write one HTML file about a scan: pictures, a summary, notes beside the log, every reading and the settings.

    Scan, room, place, board, `fit` and `receiver` are given as in `compare`. Raises InputError if the file exists
    already (unless `overwrite`), OutputError if it cannot be written. Emits the warnings of `compare`.
    """
    from sonarhw_compare.report import report_html

    path = Path(path)
    if path.exists() and not overwrite:
        raise InputError(f"{path}: exists already; choose another name, or pass overwrite=True")
    page = report_html(report(scan, room, place, board, fit=fit, receiver=receiver)).encode()
    with atomic_file(path, overwrite=overwrite) as file:
        file.write(page)


@arguments.checked(
    room=_ROOM,
    board=_BOARD,
    free=arguments.words,
    priors=arguments.words,
    receiver=_RECEIVER,
    samples=arguments.whole(0),
    seed=arguments.whole(0),
    room_tolerance=_TOLERANCE,
    exact=arguments.flag,
    options=_prediction_options,
    progress=arguments.function,
    warn=arguments.function,
)
def fit(
    scans: ScanInput | Sequence[ScanInput],
    room: RoomInput | None = None,
    places: PlaceInput | Sequence[PlaceInput] | None = None,
    board: BoardInput | None = None,
    *,
    free: str | Iterable[str] = "position,heading",
    priors: Sequence[str] = (),
    receiver: Receiver | None = None,
    samples: int = 8000,
    seed: int = 0,
    room_tolerance: float = ROOM_TOLERANCE,
    exact: bool = False,
    options: "PredictionOptions | None" = None,
    progress: "Progress | None" = None,
    warn: Warn = emit,
) -> "FittedScans":
    """Return the values of the `free` quantities that explain one or several scans best, with their uncertainties.

    Scans, room, places (one for each scan) and board are given as in `compare`. `free` and `priors` are written as for
    `sonarhw fit`: "position,heading", ["temperature=21+-1"]. A free position is searched within 25 cm of a given place,
    else in the whole room. `samples` is the number of draws from the posterior; 0 uses the curvature of the likelihood.
    Walls that are not free may be off with a standard deviation of `room_tolerance` (m), and levels and the turntable
    have tolerances of their own; `exact` takes all of these as exact. `options` are those of the prediction, in
    place of `receiver`. `progress` receives the completed share and the name of the present step. Raises InputError.
    """
    from sonarhw_sim.predict.prediction import PredictionOptions

    from sonarhw_compare.fit.fitting import FittedScans, fit_scans, fit_setting
    from sonarhw_compare.fit.result import FitOptions

    given = _given_scans(scans, board, warn)
    _check_stand(given)
    setting = fit_setting(given, room, _places(places), board, _words(free), _words(priors))
    for scan in setting.scans:
        if scan.place.name:  # otherwise the whole room is searched
            warn_of_place(setting.room, scan.place, warn)
    prediction = options or PredictionOptions(receiver=receiver)
    fit_options = FitOptions(prediction, seed, samples, room_tolerance=room_tolerance, exact=exact)
    result = fit_scans(
        setting.scans, setting.room, setting.board, setting.parameters, options=fit_options, progress=progress
    )
    return FittedScans(**vars(result), setting=setting)


@arguments.checked(
    room=_ROOM,
    board=_BOARD,
    receiver=_RECEIVER,
    height=arguments.number(unit="m"),
    heading=arguments.number(unit="rad"),
    heading_deviation=arguments.number(0, unit="rad"),
    progress=arguments.function,
    warn=arguments.function,
)
def locate(
    scan: ScanInput,
    room: RoomInput | None = None,
    board: BoardInput | None = None,
    *,
    receiver: Receiver | None = None,
    height: float | None = None,
    heading: float | None = None,
    heading_deviation: float = math.radians(5),
    progress: Tick = _silent,
    warn: Warn = emit,
) -> "Located":
    """Return the possible poses of a scan in a room, with their probabilities.

    Scan, room and board are given as in `compare`. `height` (m) of the transducer includes floor and ceiling in the
    prediction. `heading` (rad) of turntable step 0 is known within a standard deviation. `progress` receives the
    completed share, 0..1. `warn` also receives the doubts about the result. Raises InputError.
    """
    from sonarhw_sim.predict.prediction import PredictionOptions

    from sonarhw_compare.locate import known_heading, locate_scan

    (given,) = _given_scans(scan, board, warn)
    given.check_stands()
    expected, spread = known_heading(heading, heading_deviation)
    located = locate_scan(
        given.readings,
        given.room(room),
        given.board(board),
        prediction=PredictionOptions(receiver=receiver),
        height=height,
        expected=expected,
        spread=spread,
        tick=progress,
    )
    stated = given.recorded_place(located.room)
    with suppress(InputError):  # a place in another room, such as inside a post of this one
        located = replace(located, stated=None if stated is None else located.room.place(stated))
    located = replace(located, scan=given.where)
    for doubt in located.doubts:
        warn(doubt)
    return located


@arguments.checked(
    path=arguments.file_name, room=_ROOM, board=_BOARD, overwrite=arguments.flag, warn=arguments.function
)
def save_scan(
    scan: ScanInput,
    path: Path | str,
    room: RoomInput | None = None,
    place: PlaceInput | None = None,
    board: BoardInput | None = None,
    *,
    overwrite: bool = False,
    warn: Warn = emit,
) -> None:
    """Write a scan as a log, with its poses, for the commands and the window; their origin is `imported`.

    Scan, room, place and board are given as in `compare`; what is not given is not in the log. Raises InputError if the
    file exists already (unless `overwrite`), OutputError if it cannot be written.
    """
    from sonarhw.log.writer import write_scan

    (given,) = _given_scans(scan, board, warn)
    metadata = LogMetadata("import", time.time(), source="sonarhw.save_scan")
    if room is not None:
        stored = given.room(room)
        here = given.pose if place is None else stored.place(place)
        name = "" if here is None else here.name
        metadata = replace(metadata, room_file=f"{stored.name}.toml", room_text=stored.text, place=name)
    if board is not None:
        profile = given.board(board)
        if not profile.text or parse_board(profile.text, "board") != profile:
            raise InputError("board: expected a profile as in its file, got a changed one; write it to a file")
        metadata = replace(metadata, board=profile.name, board_text=profile.text)
    path = Path(path)
    if path.exists() and not overwrite:
        raise InputError(f"{path}: exists already; choose another name, or pass overwrite=True")
    write_scan(path, metadata, given.readings, overwrite=overwrite)


@arguments.checked(
    room=_ROOM,
    board=_BOARD,
    model=_MODEL,
    seed=arguments.whole(0),
    progress=arguments.function,
    warn=arguments.function,
)
def track(
    scan: ScanInput,
    room: RoomInput | None = None,
    board: BoardInput | None = None,
    start: PlaceInput | None = None,
    *,
    model: Model = Model.RAY_FOLLOWING,
    particles: int = 1000,
    spread: tuple[float, float] = (0.05, math.radians(3)),
    drift: tuple[float, float] = (0.05, math.radians(3)),
    seed: int = 0,
    progress: Tick = _silent,
    warn: Warn = emit,
) -> "Track":
    """Return the trajectory of a robot in a room, from a scan with poses, by a particle filter on its sonar.

    Scan, room and board are given as in `compare`. Of the poses, only the steps are used, as odometry. `start` is a
    place of the room, x, y (m) and a heading (rad), or "everywhere"; by default that of the log, or else its first
    pose. `model` is ray following, cone or nearest. `particles`, `spread` and `drift` are those of `Tracker`. The same
    seed gives the same result. `progress` receives the completed share, 0..1. `warn` also receives the doubts about the
    result. Raises InputError.
    """
    from sonarhw_compare.track import EVERYWHERE, track_scan

    (given,) = _given_scans(scan, board, warn)
    in_room = given.room(room)
    begin = None if isinstance(start, str) and start == EVERYWHERE else given.place(in_room, start)
    if begin is not None:
        warn_of_place(in_room, begin, warn)
    settings = {"model": model, "particles": particles, "spread": spread, "drift": drift}
    tracked = track_scan(given, in_room, given.board(board), begin, seed=seed, progress=progress, **settings)
    for doubt in tracked.doubts:
        warn(doubt)
    return tracked


@arguments.checked(
    room=_ROOM,
    board=_BOARD,
    poses=arguments.file_name,
    offset=arguments.number(unit="m"),
    find=arguments.flag,
    plan_next=arguments.flag,
    effort=arguments.choice(Effort),
    progress=arguments.function,
    warn=arguments.function,
)
def map_room(
    scans: ScanInput | Sequence[ScanInput],
    places: PlaceInput | Sequence[PlaceInput] | None = None,
    room: RoomInput | None = None,
    board: BoardInput | None = None,
    *,
    poses: Path | str | None = None,
    offset: float = 0.0,
    find: bool = False,
    plan_next: bool = False,
    effort: Effort = Effort.NORMAL,
    progress: "Progress" = _silent,
    warn: Warn = emit,
) -> "MappedScans":
    """Return the map of a room from scans, and the room found from them with `find` or `plan_next`.

    Scans, room and board are given as in `compare`. `places` (one for each scan) are by default those of the logs;
    `poses` is a table of all of them, some uncertain or unknown, as for `sonarhw map`. Sound is followed in the given
    or found room, else in one of the walls found. `offset` (m) is added to every measured range. With `plan_next`, the
    places to scan next are found. A quick `effort` gives a rough room, and the places to scan next. `progress` receives
    the completed share and the name of the present step. Raises InputError.
    """
    from sonarhw_compare.map import map_scans
    from sonarhw_compare.rooms.outcome import MappedScans

    if find and effort is Effort.QUICK:
        plan_next = True
    find = find or plan_next
    if find and room is not None:
        raise InputError("a room is found, or given; give only one of them")
    given = _given_scans(scans, board, warn)
    _check_stand(given)
    followed = None if room is None else given[0].room(room)
    profile = common_board(given, board)
    placed, spreads = _with_poses(given, followed, _places(places), poses, warn)
    unknown = [scan.where for scan, spread in zip(given, spreads, strict=False) if not spread.is_whole]
    if unknown and not find:
        raise InputError(
            f"{poses}: gives no position or no heading of {unknown[0]}; expected both of each log; write them there, "
            "or find them with the room"
        )
    moved = replace(profile, range_offset=profile.range_offset - offset)
    room_found = _room_of_scans(placed, moved, given[0], spreads, effort, plan_next, progress) if find else None
    if room_found is not None:
        followed, moved, placed = room_found.room, room_found.board, room_found.found.scans
    mapped = map_scans(placed, moved, followed, lambda share: progress(share, "mapping"))
    doubts = (*_map_doubts(mapped, room is not None, room_found), *_own_body_doubts(placed, profile))
    if room_found is not None and effort is Effort.QUICK:
        doubts = ("a quick search: the walls are rough, and some may be wrong", *doubts)
    same = not poses and all(not isinstance(place, Place) for place in _places(places))
    recorded = given[0].recorded_room if same and len({scan.room_text for scan in given}) == 1 else None
    return MappedScans(mapped, followed, room_found, recorded, doubts)


def _room_of_scans(
    scans: "Sequence[PlacedScan]",
    board: Board,
    first: GivenScan,
    spreads: "Sequence[PoseSpread]",
    effort: Effort,
    plan_next: bool,
    progress: "Progress",
) -> "RoomOfScans":
    """Return the room that scans show, with the places to scan next if wanted."""
    from sonarhw_compare.rooms.evidence import Course, as_found
    from sonarhw_compare.rooms.outcome import RoomOfScans, found_room, next_places
    from sonarhw_compare.rooms.search import find_room_and_poses

    recorded = first.recorded_room
    air = Air() if recorded is None else recorded.air
    found_room_and_poses = find_room_and_poses(
        scans, board, air, spreads, lambda share: progress(share, "finding the room"), Course(effort=effort)
    )
    room = found_room(found_room_and_poses, board)
    board_as_found, nexts = as_found(board, found_room_and_poses.draft), None
    if plan_next:
        nexts = next_places(
            found_room_and_poses, room, board_as_found, tick=lambda share: progress(share, "planning the next scan")
        )
    return RoomOfScans(found_room_and_poses, room, board_as_found, board, nexts)


def _with_poses(
    given: Sequence[GivenScan],
    room: Room | None,
    places: Sequence[PlaceInput],
    poses: Path | str | None,
    warn: Warn,
) -> "tuple[Sequence[PlacedScan], list[PoseSpread]]":
    """Return the scans at their places, and how uncertain these are."""
    from sonarhw_compare.fit.fitting import check_count, placed_scans
    from sonarhw_compare.locate import read_poses

    if poses is None:
        check_count(places, len(given))
        chosen: Sequence[PlaceInput | None] = places or [None] * len(given)
        return placed_scans(
            given, [_map_place(*scan_and_place, room, warn) for scan_and_place in zip(given, chosen, strict=True)]
        ), []
    if places:
        raise InputError(f"{poses}: contains the poses of all logs; give no other places")
    read = read_poses(Path(poses), [Path(scan.where) for scan in given])
    return placed_scans(given, [place for place, _ in read]), [spread for _, spread in read]


def _map_place(scan: GivenScan, wanted: PlaceInput | None, room: Room | None, warn: Warn) -> Place:
    """Return the given place, else the recorded one. Raises InputError if there is neither."""
    wanted = scan.pose if wanted is None else wanted
    if room is None and not scan.room_text:
        # a pose needs no room
        stated = wanted if wanted is not None or scan.log is None else scan.log.metadata.place
        pose = typed_place(stated) if isinstance(stated, str) else stated
        wanted = pose if pose is None or isinstance(pose, Place) else place_at("place", pose)
    if room is None and isinstance(wanted, Place):
        return wanted
    if room is None and not scan.room_text:
        raise InputError(f"{scan.where}: contains no room; give a pose, or a room and a place")
    placed_in = scan.room(room)
    recorded = scan.recorded_place(placed_in)
    # X,Y of another room may be anywhere in this one
    if wanted is None and recorded is not None and (scan.room_text == placed_in.text or recorded in placed_in.places):
        wanted = recorded
    if wanted is None:
        raise InputError(f"{scan.where}: contains no place in room {placed_in.name!r}; give a place or a pose")
    place = placed_in.place(wanted)
    warn_of_place(placed_in, place, warn)
    return place


@arguments.checked(
    board=_BOARD,
    distances=_numbers_of_scans,
    directions=_numbers_of_scans,
    room=_ROOM,
    reflectances=arguments.flag,
    order=arguments.instance(ScanOrder, "a ScanOrder, such as that of `sector`"),
    temperature=arguments.number(-40, 60, "°C"),
    connect=arguments.function,
    progress=arguments.function,
    warn=arguments.function,
)
def calibrate(
    scans: ScanInput | Sequence[ScanInput],
    board: BoardInput | None = None,
    *,
    distances: float | Sequence[float] = (),
    directions: float | Sequence[float] = (),
    room: RoomInput | None = None,
    places: PlaceInput | Sequence[PlaceInput] | None = None,
    reflectances: bool = False,
    order: ScanOrder | None = None,
    temperature: float | None = None,
    connect: Callable[[str], AbstractContextManager[Scanner]] | None = None,
    progress: "Progress" = _silent,
    warn: Warn = emit,
) -> "Calibration":
    """Return the calibration of a board from scans of a plate or of a known room. Its `profile` has the values found.

    Scans, room, places and board, the profile to begin with, are given as in `map_room`. For a plate, `distances` (m)
    are from the face to the plate, one for each scan, and `directions` (rad) are the turntable angles that should face
    it: one, or one for each scan; by default 0. In place of scans, the URL of a scanner that faces the plate can be
    given. It then makes the scan `order`, by default 60° around the direction, in air of `temperature` (°C; default: by
    its thermometer). `connect` opens the scanner, by default as `open_scanner`. With `reflectances`, the room of the
    result has those that the scans show. `progress` receives the completed share and the name of the present step.
    Raises InputError; NoPlate if a scan shows no plate; for a URL, what `Scanner.open` raises.
    """
    of_plate, turned, several = _floats(distances), _floats(directions), _several(scans)
    if room is None and not of_plate:
        raise InputError("expected the distance of a plate, or the room of the scans")
    if room is not None and (of_plate or turned):
        raise InputError("distances and a room: expected one of them; a plate has a distance, a room has places")
    if room is None and (reflectances or _places(places)):
        raise InputError("places and reflectances: need a room")
    if any(isinstance(scan, str) and Path(scan).suffix != ".mcap" for scan in several):
        if room is not None:
            raise InputError(f"room {room}: expected logs (*.mcap), not the URL of a scanner; scan first")
        if len(several) > 1:
            raise InputError(f"{', '.join(map(str, several))}: expected the URL of one scanner, or logs (*.mcap)")
        opened = connect or (lambda url: open_scanner(url, warn=warn))
        if len(of_plate) != 1 or len(turned) > 1:
            raise InputError("distances, directions: expected one of each for a scan by a scanner")
        return _calibrated_now(str(several[0]), board, of_plate[0], (*turned, 0.0)[0], order, temperature, opened)
    if order is not None or temperature is not None:
        raise InputError("order and temperature: are for a scan by a scanner; give its URL in place of logs")
    given = _given_scans(scans, board, warn)
    _check_stand(given)
    profile = common_board(given, board)
    if room is None:
        return _calibrated_with_plates(given, profile, of_plate, turned)
    return _calibrated_in_room(given, profile, room, _places(places), reflectances, progress, warn)


def _floats(given: float | Sequence[float]) -> list[float]:
    return [float(given)] if isinstance(given, numbers.Real) else [*cast("Sequence[float]", given)]


def check_sector(order: ScanOrder, name: str = "order") -> None:
    """Raise InputError, with the name of what was given, if a scan has too few headings for an echo of a plate."""
    from sonarhw_compare.calibration.plate_readings import FEWEST

    needed = FEWEST + 2
    if order.headings < needed:
        raise InputError(
            f"{name}: {counted(order.headings, 'heading')}; expected at least {needed}, "
            f"{FEWEST} with an echo of the plate and one without on each side; widen the sector or give smaller steps"
        )


def _calibrated_now(
    url: str,
    chosen: BoardInput | None,
    distance: float,
    direction: float,
    order: ScanOrder | None,
    temperature: float | None,
    connect: Callable[[str], AbstractContextManager[Scanner]],
) -> "Calibration":
    """Scan a plate, and return the calibration."""
    board = chosen if isinstance(chosen, Board) else load_board(chosen or DEFAULT_BOARD)
    _check_one_sensor(board)
    nearest = board.blanked_range(Air())
    if not nearest < distance < board.max_range:
        raise InputError(f"distance {distance:g}: expected {nearest:.2g} to {board.max_range:g} m, this board's range")
    if order is None:
        middle = math.degrees(direction)
        order = sector(middle - _HALF_SECTOR, middle + _HALF_SECTOR, _SECTOR_STEP, pings=_SECTOR_PINGS)
    check_sector(order)
    check_turns(url)
    with connect(url) as scanner:
        speed = ScanAir(chosen_temperature=temperature).speed_of_sound(scanner.info.temperature_c)
        scanner.configure(2 * board.max_range / speed, board.blanking_end, False, speed)
        readings = list(scanner.scan(order))
    from sonarhw_compare.calibration.plate import calibrate_facing_plate

    return calibrate_facing_plate(board, readings, distance, direction)


def _check_one_sensor(board: Board) -> None:
    if board.ring is not None:
        raise InputError(f"board {board.name}: has a ring of sensors; a plate calibrates a head on a turntable")


def _calibrated_with_plates(
    scans: Sequence[GivenScan], board: Board, distances: Sequence[float], directions: Sequence[float]
) -> "Calibration":
    """Return the calibration from scans of a plate. Raises NoPlate if one shows no plate."""
    _check_one_sensor(board)
    _check_plates(scans, board, distances, directions)
    from sonarhw_compare.calibration.plate import calibrate_with_plates
    from sonarhw_compare.calibration.plate_readings import plate_readings

    turns = list(directions) * (len(scans) if len(directions) == 1 else 1) or [0.0] * len(scans)
    readings = [
        plate_readings(Path(scan.where).name, scan.readings, distance, turn, board, _blanked_until(scan))
        for scan, distance, turn in zip(scans, distances, turns, strict=True)
    ]
    return calibrate_with_plates(board, readings)


def _check_plates(
    scans: Sequence[GivenScan], board: Board, distances: Sequence[float], directions: Sequence[float]
) -> None:
    """Raise InputError unless there is a distance for each scan, and directions as the scans need them."""
    if len(distances) != len(scans):
        raise InputError(f"distances: expected one for each of {counted(len(scans), 'log')}, got {len(distances)}")
    if len(directions) not in (0, 1, len(scans)):
        raise InputError(f"directions: expected one for all logs, or {len(scans)}, got {len(directions)}")
    for distance in distances:
        if not 0 < distance <= board.max_range:
            raise InputError(f"distance {distance:g}: expected more than 0 and at most {board.max_range:g} m")
    if not all(map(math.isfinite, directions)):
        raise InputError("directions: expected finite angles in radians")
    files = [scan.file for scan in scans if scan.file is not None]
    if twice := {file for file in files if sum(file.resolve() == other.resolve() for other in files) > 1}:
        raise InputError(f"{min(twice)}: is given twice; give each log once")


def _blanked_until(scan: GivenScan) -> float:
    """Return the blanking in the settings of the scanner, s; 0 if the log does not contain it."""
    settings = scan.log and scan.log.settings
    return seconds_of(settings.blanking_us) if settings else 0.0


def _calibrated_in_room(
    scans: Sequence[GivenScan],
    board: Board,
    room: RoomInput,
    places: Sequence[PlaceInput],
    reflectances: bool,
    progress: "Progress",
    warn: Warn,
) -> "Calibration":
    """Return the calibration from scans of a known room."""
    from sonarhw_compare.calibration.room import calibrate_in_room
    from sonarhw_compare.fit.fitting import check_count, placed_scans

    check_count(places, len(scans))
    in_room = scans[0].room(room)
    chosen: Sequence[PlaceInput | None] = places or [None] * len(scans)
    placed = placed_scans(scans, [scan.place(in_room, place) for scan, place in zip(scans, chosen, strict=True)])
    for scan in placed:
        warn_of_place(in_room, scan.place, warn)
    return calibrate_in_room(board, placed, in_room, progress, reflectances=reflectances)


def _map_doubts(mapped: "RoomMap", is_given: bool, room_found: "RoomOfScans | None") -> Iterator[str]:
    """Yield one line for each reason to doubt a map."""
    from sonarhw_compare.map import CONFIRMING

    if mapped.places < CONFIRMING:
        yield (
            f"scans from {counted(mapped.places, 'place')} only: walls, corners and edges are confirmed by "
            f"{CONFIRMING} places; until then they are possible, or missing"
        )
    if mapped.followed_room is not None and mapped.undetermined > mapped.echoes / 2:
        count = f"{mapped.undetermined} of {mapped.echoes} echoes have no path in"
        check, false = "check the board and the places of the scans", "walls may be false or missing"
        if is_given:
            yield f"{count} this room; {check}, and the room"
        elif room_found:
            yield f"{count} the found room: {false}; {check}, or give more scans"
        else:
            yield f"{count} the room in which sound is followed: {false}; give the room, or more scans"
    for title in room_found.found.left_out if room_found else ():
        yield (
            f"{title}: its pose was not found, so the room is found without it; give more of its pose, or add a scan "
            "between it and the others"
        )
    for reason in room_found.verdict.reasons if room_found else ():
        yield f"this is probably not a room: {reason}"


def _own_body_doubts(scans: "Sequence[PlacedScan]", board: Board) -> Iterator[str]:
    """Yield one line for each part of the carrier's body that scans from enough places show, and the profile lacks."""
    from sonarhw_compare.arcs import count_places
    from sonarhw_compare.calibration.room import find_own_body
    from sonarhw_compare.map import CONFIRMING

    if board.ring is not None or count_places(scan.place.position for scan in scans) < CONFIRMING:
        return
    of_room = [replace(scan, readings=without_own_body(board.own_body, scan.readings)) for scan in scans]
    for part in find_own_body(of_room):
        yield (
            f"echoes from {part.nearest:.2f} to {part.farthest:.2f} m at turntable angles {part.from_deg:.0f}° to "
            f"{part.to_deg:.0f}° are the same at most places: if they are of the carrier of the sensor, state this in "
            "the board profile ([[own_body]]; `sonarhw calibrate` finds it), else they become walls and posts"
        )


def _placed(
    scan: ScanInput, room: RoomInput | None, place: PlaceInput | None, board: BoardInput | None, warn: Warn
) -> tuple[GivenScan, Room, Place, Board]:
    """Return a scan with room, place and board: as given, else those of its log. Raises InputError."""
    (given,) = _given_scans(scan, board, warn)
    in_room, profile = given.room(room), given.board(board)
    here = given.place(in_room, place)
    warn_of_place(in_room, here, warn)
    if along := given.places(here):
        warn_of_poses(given.where, in_room, np.array([there.position for there in along]), warn)
    return given, in_room, here, profile


def _faced(board: Board, place: Place | list[Place]) -> Place | list[Place]:
    """Return a place, or several, with the actual heading of the turntable's zero."""
    return board.faced(place) if isinstance(place, Place) else [*map(board.faced, place)]


def _fitted(
    fit: str | Iterable[str],
    scan: GivenScan,
    room: Room,
    place: Place,
    board: Board,
    options: "PredictionOptions",
    progress: Tick,
    model: Model = Model.RAY_FOLLOWING,
) -> "Fit | None":
    """Return the fit on a grid of the named quantities; None if none is named."""
    if not (free := frozenset(_words(fit))):
        return None
    scan.check_stands()
    from sonarhw_compare.fit.starting import likely_fit

    return likely_fit(scan.readings, room, place, board, free, model=model, options=options, tick=progress)


def _several(scans: ScanInput | Sequence[ScanInput]) -> list[ScanInput]:
    """Return one or several scans as a list."""
    if isinstance(scans, str | Path | Log | GivenScan) or is_pair(scans):
        return [cast(ScanInput, scans)]
    if isinstance(scans, np.ndarray) or not isinstance(scans, Iterable):  # given_scan refuses it
        return [cast(ScanInput, scans)]
    several = [*cast(Sequence[ScanInput], scans)]
    return [cast(ScanInput, several)] if all(isinstance(item, Reading) for item in several) else several


def _given_scans(scans: ScanInput | Sequence[ScanInput], board: BoardInput | None, warn: Warn) -> list[GivenScan]:
    """Return one or several scans. Warns of damaged logs, of logs without a board if none is given, and of readings.

    A `GivenScan` with a log was checked by its maker.
    """
    several = _several(scans)
    given = [given_scan(scan, warn) for scan in several]
    for scan, read in zip(several, given, strict=True):
        if isinstance(scan, GivenScan) and scan.log is not None:
            continue
        doubts = read.board_doubts if board is None else ()
        for doubt in (*doubts, *read.doubts(read.board(board))):
            warn(doubt)
    return given


def _check_stand(scans: Iterable[GivenScan]) -> None:
    for scan in scans:
        scan.check_stands()


def _words(given: str | Iterable[str]) -> list[str]:
    words = given.split(",") if isinstance(given, str) else given
    return [word.strip() for word in words if word.strip()]


def _places(given: PlaceInput | Sequence[PlaceInput] | None) -> list[PlaceInput]:
    """Return places as a list; two or three numbers are one place."""
    if given is None:
        return []
    if not isinstance(given, Iterable) and not isinstance(given, Place):
        raise arguments.refusal("places", "a place, or a place for each scan", given)
    parts = [given] if isinstance(given, Place | str) else [*given]
    is_pose = parts and all(isinstance(part, numbers.Real) for part in parts)
    return [cast("Sequence[float]", parts)] if is_pose else cast("list[PlaceInput]", parts)
