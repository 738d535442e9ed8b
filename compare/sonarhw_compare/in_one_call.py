"""Compare, fit, locate or report scans in one call, from files or objects, as functions of `sonarhw`.

Each function does what the command of the same name does. Room, place and board are those given, else those in the log.
"""

import math
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import cast

from sonarhw_sim.air import Model, Receiver
from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.prediction import PredictionOptions, predict_with
from sonarhw_sim.room.room import Place, Room, place_doubts

from sonarhw.errors import InputError
from sonarhw.files import atomic_file
from sonarhw.log import Log
from sonarhw.readings import Reading
from sonarhw_compare.fit.fit_setting import fit_setting
from sonarhw_compare.fit.fitting import fit_scans
from sonarhw_compare.fit.plain_fit import Fit, fit_scan
from sonarhw_compare.fit.values.fit_result import FitOptions, FitResult, Progress
from sonarhw_compare.fit.values.quantities import ROOM_TOLERANCE
from sonarhw_compare.imports.given_scan import BoardInput, GivenScan, PlaceInput, RoomInput, ScanInput, given_scan
from sonarhw_compare.locate.pose_spread import known_heading
from sonarhw_compare.locate.poses import Located, locate_scan
from sonarhw_compare.matching.few_explained import few_explained
from sonarhw_compare.matching.match import Comparison, headings_of, match_readings
from sonarhw_compare.notes.placed_notes import PlacedNotes, notes_of_log
from sonarhw_compare.report.html_report import Report, report_html, report_of


def compare(
    scan: ScanInput,
    room: RoomInput | None = None,
    place: PlaceInput | None = None,
    board: BoardInput | None = None,
    *,
    fit: str | Iterable[str] = "",
    model: Model = Model.RAY_FOLLOWING,
    receiver: Receiver | None = None,
    progress: Callable[[float], None] = lambda _share: None,
) -> Comparison:
    """Return each reading of a scan beside its prediction.

    `scan` is a log, its file, or readings. Room, place and board are objects, names or files; by default those in the
    log, and for readings the only place of the room and the default board. `fit` names quantities to fit first, such as
    "heading,offset,position"; the position within 3 cm. The default `receiver` is that of the board profile.
    `progress` receives the completed share of the fit, 0..1. Raises InputError. Emits a Python warning if a log is
    damaged or names no board, if the place is outside the room, or if few echoes are explained.
    """
    given = given_scan(scan)
    known, profile = given.room(room), given.board(board)
    here = given.place(known, place)
    _warn_of_doubts([given] if board is None else [], known, [here])
    options = PredictionOptions(receiver=receiver)
    comparison = fitted_comparison(given, known, here, profile, fit, model=model, options=options, tick=progress)[0]
    _warn_of_few_explained(given, comparison)
    return comparison


def fitted_comparison(
    scan: GivenScan,
    room: Room,
    place: Place,
    board: Board,
    fit: str | Iterable[str],
    *,
    model: Model,
    options: PredictionOptions,
    tick: Callable[[float], None],
) -> tuple[Comparison, Fit | None]:
    """Return what `compare` returns, and the fit; None if `fit` names no quantity. Raises InputError."""
    fitted, offset, found = board.faced(place), 0.0, None
    if free := frozenset(_words(fit)):
        found = fit_scan(scan.readings, room, place, board, free, model=model, options=options, tick=tick)
        fitted, offset = found.place, found.offset
    prediction = predict_with(model, room, fitted, board, headings_of(scan.readings, fitted, board), options)
    return replace(match_readings(scan.readings, prediction, offset), origin=scan.origin), found


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
    path, given = Path(path), given_scan(scan)
    if path.exists() and not overwrite:
        raise InputError(f"{path}: exists already; choose another name, or pass overwrite=True")
    known, profile = given.room(room), given.board(board)
    here = given.place(known, place)
    _warn_of_doubts([given] if board is None else [], known, [here])
    notes = notes_of_log(Path(scan), given.readings) if isinstance(scan, str | Path) else PlacedNotes()
    for doubt in notes.doubts:
        warnings.warn(doubt, stacklevel=2)
    report = fitted_report(given, known, here, profile, fit, notes, options=PredictionOptions(receiver=receiver))
    _warn_of_few_explained(given, report.comparison)
    page = report_html(report).encode()
    with atomic_file(path, overwrite=overwrite) as file:
        file.write(page)


def fitted_report(
    scan: GivenScan,
    room: Room,
    place: Place,
    board: Board,
    fit: str | Iterable[str],
    notes: PlacedNotes,
    *,
    options: PredictionOptions,
    tick: Callable[[float], None] = lambda _share: None,
) -> Report:
    """Return the report that `write_report` writes. Raises InputError."""
    free = frozenset(_words(fit))
    found = fit_scan(scan.readings, room, place, board, free, options=options, tick=tick) if free else None
    named = replace(scan, where=Path(scan.where).name)
    return report_of(named, room, place, board, options, fit=found, notes=notes.texts)


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
    progress: Progress | None = None,
) -> FitResult:
    """Return the values of the `free` quantities that explain one or several scans best, with their uncertainties.

    Scans, room, places (one for each scan) and board are given as in `compare`. `free` and `priors` are written as for
    `sonarhw fit`: "position,heading", ["temperature=21+-1"]. A free position is searched within 25 cm of a given place,
    else in the whole room. `samples` is the number of draws from the posterior; 0 uses the curvature of the likelihood.
    Walls that are not free may be off with a standard deviation of `room_tolerance` (m), and levels and the turntable
    have tolerances of their own; `exact` takes all of these as exact. `progress` receives the completed share and the
    name of the present step. Raises InputError.
    """
    given = list(map(given_scan, _scans(scans)))
    setting = fit_setting(given, room, _places(places), board, _words(free), priors)
    placed = [scan.place for scan in setting.scans]
    _warn_of_doubts(given if board is None else [], setting.room, placed)
    options = FitOptions(
        PredictionOptions(receiver=receiver), seed, samples, room_tolerance=room_tolerance, exact=exact
    )
    return fit_scans(setting.scans, setting.room, setting.board, setting.parameters, options=options, progress=progress)


def locate(
    scan: ScanInput,
    room: RoomInput | None = None,
    board: BoardInput | None = None,
    *,
    receiver: Receiver | None = None,
    height: float | None = None,
    heading: float | None = None,
    heading_deviation: float = math.radians(5),
    progress: Callable[[float], None] = lambda _share: None,
) -> Located:
    """Return the possible poses of a scan in a room, with their probabilities.

    Scan, room and board are given as in `compare`. `height` (m) of the transducer includes floor and ceiling in the
    prediction. `heading` (rad) of turntable step 0 is known within a standard deviation. `progress` receives the
    completed share, 0..1. Raises InputError.
    """
    given = given_scan(scan)
    known, profile = given.room(room), given.board(board)
    _warn_of_doubts([given] if board is None else [], known, [])
    options = PredictionOptions(receiver=receiver)
    expected, spread = known_heading(heading, heading_deviation)
    located = locate_scan(
        given.readings,
        known,
        profile,
        prediction=options,
        height=height,
        expected=expected,
        spread=spread,
        tick=progress,
    )
    for doubt in located.doubts:
        warnings.warn(f"{given.where}: {doubt}", stacklevel=2)
    return located


def _warn_of_doubts(without_board: Iterable[GivenScan], room: Room, places: Iterable[Place]) -> None:
    """Emit what the commands print as warnings: logs that name no board, places outside the room or in an object."""
    boards = (doubt for scan in without_board for doubt in scan.board_doubts)
    for doubt in (*boards, *(doubt for place in places for doubt in place_doubts(room, place))):
        warnings.warn(doubt, stacklevel=3)


def _warn_of_few_explained(scan: GivenScan, comparison: Comparison) -> None:
    summary = comparison.summary()
    for doubt in few_explained(scan.where, summary.within_5cm, summary.n_echo):
        warnings.warn(doubt, stacklevel=3)


def _words(given: str | Iterable[str]) -> list[str]:
    words = given.split(",") if isinstance(given, str) else given
    return [word.strip() for word in words if word.strip()]


def _scans(given: ScanInput | Sequence[ScanInput]) -> list[ScanInput]:
    one_scan = isinstance(given, str | Path | Log | GivenScan) or all(isinstance(one, Reading) for one in given)
    return [cast(ScanInput, given)] if one_scan else [*cast(Sequence[ScanInput], given)]


def _places(given: PlaceInput | Sequence[PlaceInput] | None) -> list[PlaceInput]:
    if given is None:
        return []
    if isinstance(given, str | tuple | Place):
        return [given]
    return [*given]
