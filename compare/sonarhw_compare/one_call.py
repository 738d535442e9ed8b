"""Compare, fit, locate or report scans in one call, and open scanners by URL: functions of `sonarhw`."""

import math
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias, cast
from urllib.parse import parse_qsl, urlencode

from sonarhw_sim.air import DEFAULT_BOARD, Model, Receiver
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.predict.prediction import PredictionOptions, predict_with
from sonarhw_sim.room.room import Place, Room, load_room, place_doubts, room_doubts

from sonarhw.device.fake_board import BoardIdentity, FakeBoard, Wires
from sonarhw.device.faults import NO_FAULTS, Faults, FaultyDevice, faulty_identity, read_faults
from sonarhw.device.protocol import Device
from sonarhw.device.replayed_log import ReplayDevice
from sonarhw.device.served import Pace, read_pace, serve
from sonarhw.errors import InputError
from sonarhw.files import atomic_file
from sonarhw.host.scanner import Scanner
from sonarhw.host.session import PATIENCE, RECONNECT, Recorder
from sonarhw.link import PortFinder
from sonarhw.log import Log, read_log
from sonarhw.plugins.device_plugin import is_plugin, make_plugin
from sonarhw.plugins.plugin_device import PluginLink
from sonarhw.readings import Reading
from sonarhw_compare.fit.fitting import fit_scans, fit_setting
from sonarhw_compare.fit.quantities import ROOM_TOLERANCE
from sonarhw_compare.fit.result import FitOptions, FitResult, Progress
from sonarhw_compare.fit.starting import Fit, fit_scan
from sonarhw_compare.locate import Located, known_heading, locate_scan
from sonarhw_compare.match import Comparison, few_explained, headings_of, match_readings
from sonarhw_compare.report import Report, report_html, report_of
from sonarhw_compare.scans import (
    BoardInput,
    GivenScan,
    PlacedNotes,
    PlaceInput,
    RoomInput,
    ScanInput,
    given_scan,
    notes_of_log,
)

if TYPE_CHECKING:
    from sonarhw_sim.predict.room_echoes import RoomEchoes

# Compare, fit, locate or report scans in one call, from files or objects, as functions of `sonarhw`.
#
# Each function does what the command of the same name does. Room, place and board are those given, else those in the
# log.


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


# Fake scanners: `fake:ROOM?place=NAME&seed=1`, and the device that answers there.


LOOPBACK = "127.0.0.1:0"
SCHEME = "fake"
_KEYS = ("place", "heading", "board", "seed", "pace", "faults")


@dataclass(frozen=True)
class FakeUrl:
    """The settings in a `fake:` URL."""

    room: str  # name or file
    place: str | None
    heading: float | None  # of the turntable's step 0, rad; None: that of the place
    board: str
    seed: int
    pace: Pace
    faults: Faults

    def place_in(self, room: Room) -> Place:
        """Return the place in its room. Raises InputError if there is no such place."""
        place = room.place(self.place)
        return place if self.heading is None else replace(place, heading=self.heading)


def is_fake(url: str) -> bool:
    """Return whether this is the URL of a fake scanner."""
    return url.startswith(f"{SCHEME}:")


def moved_fake_url(url: str, room: str, place: str, board: str, heading: float | None = None) -> str:
    """Return the URL with another room (name or file), place and shipped board; seed, pace and faults stay.

    `heading`: of the turntable's step 0, rad; None: that of the place.
    """
    values = dict(parse_qsl(url.partition("?")[2], keep_blank_values=True)) | {"place": place, "board": board}
    values.pop("heading", None)
    if heading is not None:
        values["heading"] = f"{math.degrees(heading):.9g}"
    return f"{SCHEME}:{room}?{urlencode(values, safe=',')}"


def read_fake_url(url: str) -> FakeUrl:
    """Return the settings in `fake:ROOM?place=NAME&seed=1`. Raises InputError for unknown keys or invalid values."""
    room, _, query = url.removeprefix(f"{SCHEME}:").partition("?")
    if not room:
        raise InputError(f"{url}: room missing; expected 'fake:NAME?place=NAME' or 'fake:FILE.toml?place=NAME'")
    values = dict(parse_qsl(query, keep_blank_values=True))
    if unknown := sorted(set(values) - set(_KEYS)):
        raise InputError(f"{url}: unknown key {', '.join(unknown)}; known: {', '.join(_KEYS)}")
    return FakeUrl(
        room=room,
        place=values.get("place"),
        heading=_read_heading(values["heading"]) if "heading" in values else None,
        board=values.get("board", DEFAULT_BOARD),
        seed=_read_seed(values.get("seed", "0")),
        pace=read_pace(values.get("pace", "real")),
        faults=read_faults(values.get("faults", "")),
    )


@contextmanager
def serve_fake(url: str, warn: Callable[[str], None]) -> Iterator[Callable[[], str]]:
    """Serve the fake scanner of a `fake:` URL, and yield a function that returns its present URL."""
    settings = read_fake_url(url)
    room = load_room(settings.room)
    if settings.place is None and len(room.places) > 1:
        raise InputError(f"{url}: the room has several places; add ?place=NAME, one of {', '.join(room.places)}")
    place = settings.place_in(room)
    for doubt in room_doubts(room):
        warn(f"{settings.room}: {doubt}")
    for doubt in place_doubts(room, place):
        warn(doubt)
    device, _ = fake_device(room, place, load_board(settings.board), settings.seed, settings.faults)
    with serve(device, tcp=LOOPBACK, pace=settings.pace) as endpoint:
        yield lambda: endpoint.url


def fake_device(room: Room, place: Place, board: Board, seed: int, faults: Faults) -> "tuple[Device, RoomEchoes]":
    """Return a fake board at a place of a room, and its echo source, which the first scan prepares."""
    from sonarhw_sim.predict.room_echoes import RoomEchoes  # loads the kernels, which takes a second

    # a fake is one sensor: the spreads of a population, or of errors of the room, are no noise of its pings
    echoes = RoomEchoes(room, place, board.certain, seed)
    wires = Wires(faults.miswire)
    ready = _prepared_on_demand(echoes)
    identity = faulty_identity(BoardIdentity(serial=f"FAKE-{seed:04d}", profile=board.name), faults)

    def started(boots: int) -> FakeBoard:
        counted_identity = replace(identity, boot=1 + boots)
        return FakeBoard(echoes, seed, board.blanking_end, counted_identity, ready, wires=wires)

    return started(0) if faults == NO_FAULTS else FaultyDevice(started, faults, seed), echoes


def _prepared_on_demand(echoes: "RoomEchoes") -> Callable[[], bool]:
    """Return a function that returns whether preparation is over; its first call starts it in a thread.

    So a command that does not scan saves the time of preparation, and the board answers during it.
    """

    def prepare() -> None:
        with suppress(InputError):  # the first ping raises it again
            echoes.prepare()

    # a daemon thread, so that the process can end during a compilation
    thread = threading.Thread(target=prepare, name="prepare", daemon=True)

    def over() -> bool:
        if thread.ident is None:
            thread.start()
        return not thread.is_alive()

    return over


def _read_heading(text: str) -> float:
    try:
        heading = math.radians(float(text))
    except ValueError:
        heading = math.nan
    if not math.isfinite(heading):
        raise InputError(f"heading {text!r}: expected degrees")
    return heading


def _read_seed(text: str) -> int:
    if not text.isdecimal():
        raise InputError(f"seed {text!r}: expected a whole number, 0 or more")
    return int(text)


# Open a scanner at any URL: `open_scanner` of `sonarhw`.
#
# To add a scheme for a device that speaks the wire protocol, add a line to SCHEMES: the function that makes the
# scanner of a URL available. For any other device, write a plug-in (`sonarhw.plugins.device_plugin`).


Find: TypeAlias = Callable[[], str]  # returns the URL to open with pyserial now
Warn: TypeAlias = Callable[[str], None]

# by scheme: makes a scanner available until the end of the block; other URLs are opened by pyserial
SCHEMES: dict[str, Callable[[str, Warn], AbstractContextManager[Find]]] = {SCHEME: serve_fake}


def _emit(message: str) -> None:
    """Emit a Python warning."""
    warnings.warn(message, stacklevel=2)


def open_scanner(
    url: str,
    *,
    recorder: Recorder | None = None,
    patience: float = PATIENCE,
    reconnect: float = RECONNECT,
    warn: Warn = _emit,
) -> Scanner:
    """Open the scanner at a URL. Close it after use, or use it as a context manager.

    The URL is a serial port (`/dev/ttyUSB0`, `COM3`), another URL that pyserial opens (`socket://HOST:PORT`), a fake
    scanner in this process (`fake:laboratory?place=bench&seed=1`), a log (`scan.mcap`), which is replayed, or a device
    that prints text (`lines:/dev/ttyUSB0?baud=9600&preset=arduino-radar`). Installed plug-ins add other schemes. The
    scanner must answer within `patience` s. If it is lost later and comes back within `reconnect` s, its job continues.
    `warn` receives warnings about the room or log; by default they are Python warnings. Raises InputError for an
    invalid URL, and what `Scanner.open` raises.
    """
    if is_plugin(url):
        return Scanner.open(url, recorder, patience, reconnect, plugin=PluginLink(make_plugin(url)))
    with ExitStack() as stack:
        find = stack.enter_context(resolve(url, warn))
        return Scanner.open(url, recorder, patience, reconnect, find, on_close=stack.pop_all().close)


@contextmanager
def resolve(url: str, warn: Warn = _emit) -> Iterator[Find]:
    """Yield a function that returns the URL to open with pyserial now.

    This process serves `fake:` URLs and logs until the block ends. Call the function before each opening, because a
    device may return under another name. Raises InputError for the URL of a plug-in.
    """
    if is_plugin(url):
        raise InputError(f"{url}: this device does not speak the wire protocol; `sonarhw scan` records its readings")
    available = SCHEMES.get(url.partition(":")[0])
    if available is not None:
        with available(url, warn) as find:
            yield find
    elif Path(url).suffix == ".mcap":
        with _replay(Path(url), warn) as find:
            yield find
    else:
        yield PortFinder(url)


@contextmanager
def _replay(path: Path, warn: Warn) -> Iterator[Find]:
    log = read_log(path)
    for doubt in log.doubts:
        warn(f"{path}: {doubt}")
    with serve(ReplayDevice(log), tcp=LOOPBACK) as endpoint:
        yield lambda: endpoint.url
