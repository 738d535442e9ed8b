"""The files of the window: opening, following, saving and listing them, as functions for background jobs."""

import math
import os
import re
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import count, zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Literal, TypeAlias
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray
from sonarhw_compare.import_formats import JSON_MCAP, MCAP, ROS, TEXT, ImportFormat, import_format, start_of_file
from sonarhw_compare.picture_file import write_film
from sonarhw_compare.room_import.imported import import_room
from sonarhw_compare.scans import ReadingNote, placed_notes
from sonarhw_compare.sound import PlayedPing
from sonarhw_sim.board.profile import Board, without_own_body
from sonarhw_sim.files import file_name, quoted, read_text
from sonarhw_sim.room.room import Place, Room, load_room, parse_room
from sonarhw_sim.room.room_writing import with_place

from sonarhw.errors import InputError, LogError, OutputError, SonarError, json_text, shortened
from sonarhw.export import export_format, export_suffixes
from sonarhw.files import atomic_file
from sonarhw.log import Log, read_log
from sonarhw.log.writer import write_scan
from sonarhw.readings import Reading
from sonarhw.scan_check import ANY_BOARD, check_scan
from sonarhw_gui.model.edits import room_and_place
from sonarhw_gui.model.scene import Scene, first_place, scene_of_log, scene_with

if TYPE_CHECKING:
    from sonarhw_compare.corrections import Correction
    from sonarhw_compare.imports import ImportedScan

    from sonarhw.text.proposals import TextTable


SHOWN_LINES = 12


@dataclass(frozen=True)
class LookedAt:
    """A file of another program as it would be imported, or why it cannot be."""

    kind: "ImportFormat | None" = None
    table: "TextTable | None" = None  # the columns of a text
    scan: "ImportedScan | None" = None
    problem: str = ""
    doubts: tuple[str, ...] = ()  # what is probably wrong in the readings
    lines: tuple[tuple[str, int], ...] = ()  # the first ones, and the number of readings in each
    likely_no_echo: float | None = None  # in the unit of the file

    @property
    def readings(self) -> tuple[Reading, ...]:
        """The readings; none if the file cannot be imported."""
        return () if self.scan is None else self.scan.readings


def look_at_scan(path: Path, stated: Mapping[str, Any]) -> LookedAt:
    """Read a whole file of another program; `stated` are fields of `ImportOptions`."""
    from sonarhw_compare.imports import ImportOptions, columns_of_file, first_lines, import_scan  # takes 0.3 s

    seen = LookedAt()
    try:
        options = ImportOptions(**stated)
        seen = LookedAt(import_format(path, options.rate, options.format))
        if seen.kind is TEXT:
            seen = replace(seen, table=columns_of_file(path, options.decimal_comma), lines=first_lines(path))
        scan = import_scan(path, options)
    except SonarError as error:
        return replace(seen, problem=str(error).removeprefix(f"{path}: "))
    lines = scan.lines or seen.lines
    return replace(seen, scan=scan, doubts=scan.doubts(), lines=lines, likely_no_echo=scan.likely_no_echo)


LOG, ROOM = ".mcap", ".toml"
DRAWINGS = (".dxf", ".svg", ".geojson", ".json")
FOREIGN_ROOMS = (".yaml", ".yml", ".world", ".sdf", *DRAWINGS)
_GEOJSON = re.compile(rb'"type"\s*:\s*"(Feature|Geometry|Polygon|Multi|LineString|Point|Topology)')


def file_kind(path: Path) -> Literal["log", "room", "scan"]:
    """Return what a file or a folder is opened as, by its suffix or else its content: a scan of any other program."""
    ending = path.suffix.lower()
    if ending == ".json":
        return "room" if _GEOJSON.search(start_of_file(path)) else "scan"
    if ending in (ROOM, *FOREIGN_ROOMS):
        return "room"
    # a damaged log is opened as a log, which says what is wrong with it
    is_mcap = start_of_file(path).startswith(MCAP)
    is_foreign = ending != LOG or (is_mcap and import_format(path, None) in (ROS, JSON_MCAP))
    return "scan" if is_foreign else "log"


_MOST_NAMES = 10


@dataclass(frozen=True)
class Opened:
    """A log and its scene, or the scene of a room file at its first place; without a room if the log contains none."""

    path: Path | None  # None: a shipped room
    scene: Scene
    log: Log | None = None
    notice: str = ""  # where an imported file was stored


def open_log(path: Path, last_scene: Scene | None = None) -> Opened:
    """Read a log; `last_scene`: the scene of the last session instead of that in the log. Raises InputError."""
    log = read_log(path)
    return Opened(path, last_scene or scene_of_log(log.metadata, log.readings), log)


def check_readings(log: Log) -> tuple[str, ...]:
    """Return what is probably wrong in the readings of a log, if its board made them; without a board, any board."""
    from sonarhw_compare.scans import board_of_log, reach_of

    metadata = log.metadata
    known = metadata.board or metadata.board_text
    board = board_of_log(metadata) if known else None
    readings = log.readings if board is None else without_own_body(board.own_body, log.readings)
    return tuple(map(str, check_scan(readings, ANY_BOARD if board is None else reach_of(board))))


def read_grown_log(path: Path) -> tuple[Path, Log, float]:
    """Read a log that is being written once more; return its path too, and the time that took, s. Raises InputError."""
    began = time.perf_counter()
    log = read_log(path)
    return path, log, time.perf_counter() - began


def import_scan(file: Path, scan: "ImportedScan", folder: Path) -> Opened:
    """Write the scan in a file as a log in `folder`, and read it. Raises InputError, LogError, OutputError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise LogError(f"{folder}: cannot be created: {error.strerror}; imported scans are stored there") from error
    path = free_name(folder, file.stem, LOG)
    write_scan(path, scan.metadata(), scan.readings)
    return replace(open_log(path), notice=f"{file.name} was imported as {path.name}, in {folder}")


def correct_log(log: Path, correction: "Correction", folder: Path) -> Opened:
    """Import a log again with clockwise angles or in another unit. Raises InputError, LogError, OutputError."""
    from sonarhw_compare import imports  # takes 0.3 s

    options = imports.ImportOptions(
        turn="cw" if correction.turn < 0 else "", scale=None if correction.scale == 1.0 else correction.scale
    )
    return import_scan(log, imports.import_scan(log, options), folder)


def open_room(room_name: Path | str, board: Board, unit: str = "") -> Opened:
    """Read a room file, or a shipped room by its name, for a board. Raises InputError.

    A file of another program is imported: it has no room file yet. `unit`: of a drawing that states none.
    """
    if isinstance(room_name, Path) and room_name.suffix.lower() in FOREIGN_ROOMS:
        imported = import_room(room_name, unit=unit)
        room = imported.room if imported.room.places else _with_place_in_the_middle(imported.room)
        scene = scene_with(board, room, first_place(room), f"{room_name.stem}{ROOM}")
        return Opened(None, scene, notice=f"{room_name.name} was imported; {'; '.join(imported.notes)}")
    room = load_room(room_name)
    path = room_name if isinstance(room_name, Path) else None
    return Opened(path, scene_with(board, room, first_place(room), file_name(room_name)))


def _with_place_in_the_middle(room: Room) -> Room:
    """Return a room of another program, which names no place, with the sensor in its middle. Raises InputError."""
    points = np.vstack((room.walls.reshape(-1, 2), room.posts[:, :2]))
    x, y = ((points.min(axis=0) + points.max(axis=0)) / 2).tolist()
    return with_place(room, Place("scanner", (x, y)))


def at_kept_place(opened: Scene, shown: Scene, recorded: str) -> Scene:
    """Return an opened scene at the place shown if that is in the same room, which was reloaded.

    Else at the place where the readings were `recorded`, if the room has a place of this name.
    """
    room, reloaded = opened.room, shown.room is not None and shown.room_file == opened.room_file
    for name in (shown.pose.name if reloaded else "", recorded):
        if room is not None and name in room.places:
            return replace(opened, place=room.place(name))
    return opened


def free_name(folder: Path, stem: str, suffix: str) -> Path:
    """Return a file in `folder` that does not exist: the stem, with a number from 2 on if necessary."""
    names = (folder / f"{stem}{'' if k == 1 else f'_{k}'}{suffix}" for k in count(1))
    return next(name for name in names if not name.exists())


def with_newest(names: tuple[str, ...], name: str) -> tuple[str, ...]:
    """Return a short list of names with `name` in front, without duplicates."""
    return (name, *(other for other in names if other != name))[:_MOST_NAMES]


class Documents:
    """The files that were opened or saved last, and the folder where the next one is saved."""

    def __init__(self, recordings: Path) -> None:
        """`recordings`: the folder of recordings, where nothing else is saved."""
        self.recent: tuple[str, ...] = ()
        self.saved_in: Path | None = None
        self._recordings = recordings

    def add(self, path: Path) -> None:
        """Note that a file was opened or saved."""
        self.recent = with_newest(self.recent, str(path.absolute()))

    def folder(self, shown: str = "") -> Path:
        """Return the folder for a save dialog: the last one used, else that of the file shown or opened last.

        The folder of recordings and folders without write permission are skipped; the default is the home folder.
        """
        if self.saved_in is not None:
            return self.saved_in
        folders = (Path(name).parent for name in (shown, *self.recent) if name)
        fit = (folder for folder in folders if folder != self._recordings and os.access(folder, os.W_OK))
        return next(fit, Path.home())


LOOK_EVERY = 1.0  # s between two looks at a file


Stamp: TypeAlias = tuple[int, int]  # what a change of a file changes: its time, ns since the epoch, and its size, bytes
WatchedFile: TypeAlias = Literal["room", "board"]


def changed_outside(path: Path, text: str) -> str:
    """Return what another program has changed in a room file since its content was `text`; empty: nothing.

    A file that is gone is no change: saving it loses nothing.
    """
    if not path.exists():
        return ""
    try:
        now = read_text(path, "room file")
    except InputError as error:
        return str(error)
    if now == text:
        return ""
    lines = enumerate(zip_longest(now.splitlines(), text.splitlines()), 1)
    number, line = next(((k, line) for k, (line, before) in lines if line != before), (1, ""))
    change = f"{path.name} was changed outside: line {number} is now {quoted(shortened((line or '').strip(), 60))}"
    try:
        parse_room(now, path.name)
    except InputError as error:
        return f"{change}; it is not a valid room: {error}"
    return change


def keep_copy(path: Path) -> Path:
    """Copy a file under a new name in its folder, and return the copy. Raises OutputError."""
    copy = free_name(path.parent, f"{path.stem}-before", path.suffix)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise OutputError(f"{path}: cannot be copied: {error.strerror}; save the room under another name") from error
    with atomic_file(copy, "folder") as file:
        file.write(content)
    return copy


class FileWatch:
    """Looks at the files once a second, and reports each change once."""

    def __init__(self) -> None:
        self._files: dict[WatchedFile, tuple[Path, Stamp | None]] = {}
        self._look_at = 0.0

    def watch(self, what: WatchedFile, path: Path | None) -> None:
        """Report changes of this file from now on; None: of no file."""
        self._files.pop(what, None)
        if path is not None:
            self._files[what] = path, stamp_of(path)

    def path(self, what: WatchedFile) -> Path | None:
        """Return the file of this kind; None if none is watched."""
        return self._files[what][0] if what in self._files else None

    def changed(self, now: float) -> Iterator[tuple[WatchedFile, Path]]:
        """Yield the files that have changed since the last look. A missing file may be about to be replaced."""
        if now < self._look_at:
            return
        self._look_at = now + LOOK_EVERY
        for what, (path, before) in list(self._files.items()):
            stamp = stamp_of(path)
            if stamp is not None and stamp != before:
                self._files[what] = path, stamp
                yield what, path


def stamp_of(path: Path) -> Stamp | None:
    """Return the stamp of a file; None if it is missing or cannot be looked at."""
    try:
        status = os.stat(path)
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size


TORN_AFTER = 3.0  # s without growth, after which a log that was just written is reported as torn
_RECENT = 5.0  # s; a log that was written within this time is taken to be in use
_GROWING = 10.0  # s; a log without a change for so long is not growing any more
_REST = 5.0  # times the duration of reading the log, before the next look at it


class FollowedLog:
    """The file of a torn log, and the warning about it. All times are s on one clock."""

    def __init__(self) -> None:
        self._path: Path | None = None
        self._stamp: Stamp | None = None  # at the last look
        self._look_at = self._grown_at = -math.inf
        self._warning, self._warn_at = "", math.inf

    def follow(self, path: Path | None, warning: str, now: float) -> None:
        """Follow a torn log; None: it is in no file. The warning is due when the log no longer grows, else now."""
        self._path, self._stamp = path, None if path is None else stamp_of(path)
        self._look_at, self._grown_at = now, -math.inf
        in_use = self._stamp is not None and time.time() - self._stamp[0] / 1e9 < _RECENT
        self._warning, self._warn_at = warning, now + (TORN_AFTER if in_use else 0.0)

    def stop(self) -> None:
        """Follow nothing, and drop the warning."""
        self._path, self._grown_at, self._warn_at = None, -math.inf, math.inf

    def grows(self, now: float) -> bool:
        """Return whether the log has grown within the last seconds."""
        return now - self._grown_at < _GROWING

    def due_warnings(self, now: float) -> list[str]:
        """Return the warning if it is due, once."""
        if now < self._warn_at:
            return []
        self._warn_at = math.inf
        return [self._warning]

    def grown_file(self, now: float) -> Path | None:
        """Return the file if it has grown since the last look; it must then be read again."""
        if self._path is None or now < self._look_at:
            return None
        self._look_at = now + LOOK_EVERY
        stamp = stamp_of(self._path)
        if stamp is None or stamp == self._stamp:
            return None
        self._stamp, self._grown_at, self._warn_at = stamp, now, math.inf
        return self._path

    def rest(self, took: float, now: float) -> None:
        """Let a log that takes `took` s to read grow for a while before the next look."""
        self._look_at = now + max(LOOK_EVERY, _REST * took)


_SLICE = 0.2  # s of reading between updates of the list


@dataclass(frozen=True)
class RecordingRow:
    """One log."""

    path: Path
    changed: float  # modification time, s since the epoch
    began: float  # start of the scan, s since the epoch
    room: str
    place: str
    readings: int
    traces: bool
    condition: str  # whole, torn, damaged, or why the file cannot be read


def list_recordings(folder: Path, read: Iterable[RecordingRow] = ()) -> tuple[list[RecordingRow], int]:
    """Read more recordings of a folder for `_SLICE` s. Return those read so far, newest first, and the number of logs.

    A file that was `read` and has not changed is not read again. Raises InputError if the folder cannot be read.
    """
    files = _files(folder)
    rows_before = {row.path: row for row in read}
    rows, until = [], time.monotonic() + _SLICE
    for path, changed in files:
        before = rows_before.get(path)
        if before is not None and before.changed == changed:
            rows.append(before)
        elif time.monotonic() < until:
            rows.append(_recording(path, changed))
    rows.sort(key=lambda row: -row.began)
    return rows, len(files)


def _files(folder: Path) -> list[tuple[Path, float]]:
    """Return the logs of a folder with their modification times, newest first; none if there is no folder yet."""
    try:
        logs = [(path, path.stat().st_mtime) for path in folder.glob("*.mcap")]
    except OSError as error:
        raise InputError(f"{folder}: cannot be read: {error.strerror}") from error
    return sorted(logs, key=lambda log: -log[1])


def _recording(path: Path, changed: float) -> RecordingRow:
    try:
        log = read_log(path)
    except InputError as error:
        reason = str(error).removeprefix(f"{path}: ")
        return RecordingRow(path, changed, changed, "", "", 0, False, reason)
    traces = any(reading.trace is not None for reading in log.readings[:1])
    made = log.metadata
    return RecordingRow(
        path, changed, made.started or changed, _room(log), made.place, len(log.readings), traces, log.condition
    )


def _room(log: Log) -> str:
    """Return the name of the room in a log, else the name of its room file."""
    try:
        return parse_room(log.metadata.room_text, "room").name if log.metadata.room_text else log.metadata.room_file
    except InputError:
        return log.metadata.room_file


_SVG, _LINK = "http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"
_PAIR = re.compile(r"(-?\d[\d.e+-]*|-?\.\d+),(-?\d[\d.e+-]*|-?\.\d+)")
_EFFECT = "vector-effect"
_SHAPES = tuple(f"{{{_SVG}}}{name}" for name in ("path", "polyline", "polygon", "rect"))
_RECT, _PATH = f"{{{_SVG}}}rect", f"{{{_SVG}}}path"

Matrix = tuple[float, ...]  # a, b, c, d, e, f of SVG


def with_own_coordinates(svg: str) -> str:
    """Return the same drawing with transformed coordinates, and text in a font that every system has.

    Qt's generator scales shapes by a transform and keeps line widths by `vector-effect`, which only browsers support.
    """
    ElementTree.register_namespace("", _SVG)
    ElementTree.register_namespace("xlink", _LINK)
    root = ElementTree.fromstring(svg)
    for group in root.iter(f"{{{_SVG}}}g"):
        shapes = [*group]
        scaled = any(shape.get(_EFFECT) for shape in shapes) and all(shape.tag in _SHAPES for shape in shapes)
        matrix = _matrix(group.get("transform", "")) if scaled else None
        if matrix is not None:
            for shape in shapes:
                _place(shape, matrix)
            del group.attrib["transform"]
    for element in root.iter():
        if element.get("font-family") == "Sans Serif":
            element.set("font-family", "sans-serif")
    return ElementTree.tostring(root, encoding="unicode")


def _matrix(transform: str) -> Matrix | None:
    matched = re.fullmatch(r"matrix\(([^)]*)\)", transform)
    return tuple(float(number) for number in matched[1].split(",")) if matched else None


def _place(shape: ElementTree.Element, matrix: Matrix) -> None:
    shape.attrib.pop(_EFFECT, None)
    if shape.tag == _RECT:
        x, y, width, height = (float(shape.attrib.pop(key, "0")) for key in ("x", "y", "width", "height"))
        shape.tag = _PATH
        shape.set("d", f"M{x},{y} L{x + width},{y} L{x + width},{y + height} L{x},{y + height} Z")
    for key in ("d", "points"):
        if key in shape.attrib:
            shape.set(key, _PAIR.sub(lambda pair: _moved(float(pair[1]), float(pair[2]), matrix), shape.attrib[key]))


def _moved(x: float, y: float, matrix: Matrix) -> str:
    a, b, c, d, e, f = matrix
    return f"{a * x + c * y + e:.7g},{b * x + d * y + f:.7g}"


JSON, HTML, PNG, SVG, PDF = ".json", ".html", ".png", ".svg", ".pdf"
PICTURES, DATA, REPORT = (PNG, PDF, SVG), (*export_suffixes(), JSON), (HTML,)

# Each writer takes what it writes and then the file, in a thread. It raises SonarError.


def write_png(pixels: NDArray[np.uint8], file: BinaryIO) -> None:
    """Write a picture, (height, width, 4)."""
    from matplotlib.image import imsave  # takes half a second; only the first picture needs it

    imsave(file, pixels, format="png")


def write_pdf(page: bytes, file: BinaryIO) -> None:
    """Write a PDF as Qt has drawn it."""
    file.write(page)


def write_svg(svg: str, file: BinaryIO) -> None:
    """Write a picture as Qt has drawn it."""
    file.write(with_own_coordinates(svg).encode())


def write_data(recorded: Log | Path, scene: Scene, notes: Sequence[ReadingNote], ending: str, file: BinaryIO) -> None:
    """Write readings as `sonarhw log export` does, or the summary of `sonarhw compare --json`."""
    log = _log_of(recorded)
    if ending == JSON:
        file.write(_summary(log, scene).encode())
    else:
        export_format(ending).write(log, file, _notes_in(log, notes))


def write_report(
    name: str,
    recorded: Log | Path,
    scene: Scene,
    link: Sequence[tuple[str, str]],
    notes: Sequence[ReadingNote],
    file: BinaryIO,
) -> None:
    """Compute the report about a log in a scene, which takes some seconds, and write it."""
    from sonarhw_compare.report import report_html, report_of
    from sonarhw_compare.scans import GivenScan

    log = _log_of(recorded)
    room, place = room_and_place(scene)
    report = report_of(
        GivenScan(name, log.readings, log),
        room,
        place,
        scene.board,
        scene.options,
        link=tuple(link),
        notes=_notes_in(log, notes),
    )
    file.write(report_html(report).encode())


def write_sound(ping: PlayedPing, ending: str, file: BinaryIO) -> None:
    """Write a film of one ping as `sonarhw simulate --out FILE.gif` does, which takes some seconds.

    Raises MissingExtra for a video without PyAV.
    """
    from sonarhw_compare.film import FilmTiming  # loads matplotlib, which the window does not need

    write_film(ping, FilmTiming(), file, ending)


def save_file(write: Callable[[BinaryIO], None], endings: Sequence[str], path: Path, overwrite: bool) -> Path:
    """Write a file completely or not at all; return its path. `endings`: the possible extensions.

    Raises InputError, OutputError.
    """
    from sonarhw.files import atomic_file

    if path.suffix.lower() not in endings:
        raise InputError(f"{path.name}: expected a name ending in {' or '.join(endings)}")
    if path.is_symlink() and path.resolve().suffix.lower() not in endings:
        raise InputError(f"{path}: is a link to {path.resolve()}; choose another name")
    if path.exists() and not overwrite:
        raise InputError(f"{path}: exists already; choose another name")
    with atomic_file(path, "name", overwrite=overwrite) as file:
        write(file)
    return path


def _log_of(recorded: Log | Path) -> Log:
    return read_log(recorded) if isinstance(recorded, Path) else recorded


def _notes_in(log: Log, notes: Sequence[ReadingNote]) -> dict[int, str]:
    """Return notes by the place of their reading in the log: those of a live scan may be in another order there."""
    return placed_notes(notes, log.readings, Path(), Path()).texts


def _summary(log: Log, scene: Scene) -> str:
    from sonarhw_compare.match import compare_readings
    from sonarhw_compare.scans import places_at

    room, _ = room_and_place(scene)
    poses = scene.poses_of(log.readings)
    where = scene.pose if poses is None else places_at(scene.pose, poses)
    compared = compare_readings(log.readings, room, where, scene.board, scene.options)
    return json_text(asdict(replace(compared, origin=log.origin).summary())) + "\n"
