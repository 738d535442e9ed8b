"""`sonarhw demo` and `sonarhw gui`: open the window."""

import gc
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, replace
from functools import partial
from itertools import count
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated

import typer
from sonarhw_sim.air import DEFAULT_BOARD, Receiver

from sonarhw.errors import InputError, MissingExtra, did_you_mean, json_text
from sonarhw.files import atomic_file
from sonarhw_cli.inputs import at_height, resolve
from sonarhw_cli.options import LOG, ROOM_NAME, ForceFiles, Height, PlaceName, ReceiverChoice, print_line
from sonarhw_cli.outputs import made_folder, refuse_existing_in

if TYPE_CHECKING:
    from sonarhw_compare.scanner_url import Find
    from sonarhw_gui.model.scene import Scene
    from sonarhw_gui.session.scanner import ScannerOpener, ScannerTarget
    from sonarhw_gui.window.start import WindowStart

    from sonarhw.host.scanner import Scanner
    from sonarhw.log import Log

# `sonarhw gui`: open the window on a log, scans of other programs, a room, a scanner or the demo.


_LOG, _SCAN, _ROOM = "log", "scan", "room"  # kinds of files


@dataclass(frozen=True)
class _Request:
    """Room, place, board, height and receiver of the options; None if not given."""

    room: str | None = None
    place: str | None = None
    board: str | None = None
    height: float | None = None
    receiver: Receiver | None = None

    def predicted(self, scene: "Scene") -> "Scene":
        """Return a scene with the height and the receiver. Raises InputError for the height of a named place."""
        scene = replace(scene, options=replace(scene.options, receiver=self.receiver)) if self.receiver else scene
        if self.height is None:
            return scene
        at_height(self.place, self.height, scene.room)
        return replace(scene, place=scene.place and replace(scene.place, height=self.height))


_NOTHING = _Request()


Sources = Annotated[
    list[str] | None,
    typer.Argument(
        help="Log, scans of other programs, room (name or file), serial port, socket://HOST:PORT or "
        "'fake:ROOM?place=NAME'.",
        metavar="LOG|SCAN|URL|ROOM",
    ),
]
BoardShown = Annotated[
    str | None, typer.Option(help="Board profile; default: the log's or the scanner's.", metavar="NAME|FILE.toml")
]


def gui(
    sources: Sources = None,
    room: Annotated[str | None, typer.Option(help="Room: name or file; default: the log's.", metavar=ROOM_NAME)] = None,
    place: PlaceName = None,
    board: BoardShown = None,
    height: Height = None,
    receiver: ReceiverChoice = None,
) -> int:
    """Open the window on a log, scans of other programs, a room or a scanner.

    A scan of another program is shown as it would be imported. Without arguments, the last session is reopened; if
    there is none, the demo.
    """
    with _collector_held():
        return _open(sources or [], _Request(room, place, board, height, receiver))


def show_demo() -> int:
    """Open the window on a fake scanner in the demo room."""
    from sonarhw_compare.scanner_url import demo_url

    with _collector_held():
        return _scan(demo_url(), _NOTHING, follows=True)


@contextmanager
def _collector_held() -> Iterator[None]:
    """Collect no garbage until the window is open, which then does so itself.

    The imports create 100 000 objects that stay; searching them again and again takes 0.2 s.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def _open(sources: list[str], request: _Request) -> int:
    others, room_named = _sources_and_room(sources, request.room)
    request = replace(request, room=request.room or room_named)
    if others and _kind(others[0]) == _LOG:
        return _replay(Path(others[0]), request)
    if others and _kind(others[0]) == _SCAN:
        return _show_scans([Path(other) for other in others], request)
    if others:
        return _scan(others[0], request)
    if room_named is not None:
        return _show_room(room_named, request)
    from sonarhw_compare.scanner_url import demo_url

    return _scan(demo_url(), request, resume=request == _NOTHING, follows=True)


def _sources_and_room(sources: list[str], room: str | None) -> tuple[list[str], str | None]:
    """Return what to open, and the room if there is one. Raises InputError for several sources or rooms.

    Only scans of other programs may be several.
    """
    rooms = [source for source in sources if _kind(source) == _ROOM]
    others = [source for source in sources if source not in rooms]
    if len(others) > 1 and any(_kind(other) != _SCAN for other in others):
        raise InputError(f"{' '.join(others)}: expected one log or scanner at a time, or scans of other programs")
    if len(rooms) + (room is not None) > 1:
        raise InputError(f"{' '.join([*rooms, *([f'--room {room}'] if room else [])])}: expected one room")
    return others, (rooms[0] if rooms else None)


def _kind(source: str) -> str:
    """Return the kind of a file that can be opened; empty for a URL. Raises InputError for anything else."""
    from sonarhw_compare.scanner_url import is_fake

    from sonarhw.plugins.device_plugin import is_plugin

    if is_fake(source) or is_plugin(source) or "://" in source:
        return ""
    from sonarhw_sim.room.room import room_names

    if source in room_names():
        return _ROOM
    from sonarhw_gui.jobs.files import file_kind

    path = Path(source)
    if path.suffix.lower() in (LOG, ".toml") or path.is_file() or path.is_dir():
        return file_kind(path)
    expected = f"expected a log (*{LOG}), a scan, a room (name or *.toml) or the URL of a scanner"
    if sys.platform != "win32" and ":" not in source and not path.exists():
        from sonarhw.link import port_meant

        port = port_meant(source)
        names = [*room_names(), *map(str, path.parent.glob("*"))]
        near = f"; {port}" if port else did_you_mean(source, names)
        raise InputError(f"{source}: there is no such file or port{near}{'' if near.endswith('?') else ';'} {expected}")
    return ""


def _replay(path: Path, request: _Request) -> int:
    from sonarhw_gui.window.display import check_display

    from sonarhw_cli.inputs import open_log

    log = open_log(path)
    scene = request.predicted(_log_scene(log, request))
    named = quote(str(path))
    check_display(
        f"`sonarhw report {named} --out FILE.html` and `sonarhw compare {named} --plot FILE.png` work without a window"
    )
    from sonarhw_gui.window.start import WindowStart

    used = (*_used(request.room), path)
    return _run(WindowStart(scene, log, source_name=path.name, source_file=path, used=used))


def _show_scans(paths: list[Path], request: _Request) -> int:
    scene = request.predicted(_scene(request, begin_at=""))
    instead = f"`sonarhw import {quote(str(paths[0]))}` makes a log, and `sonarhw report` works without a window"
    return _show(scene, request.room, paths, instead)


def _show_room(room: str, request: _Request) -> int:
    instead = f"`sonarhw simulate {quote(room)} --out FILE.png` works without a window"
    return _show(request.predicted(_scene(request, begin_at="")), room, [], instead)


def _show(scene: "Scene", room: str | None, files: list[Path], instead: str) -> int:
    """Open the window on a scene without a scanner, and open `files` in it. `instead` is for a missing display."""
    from sonarhw_gui.window.display import check_display

    check_display(instead)
    from sonarhw_gui.window.start import WindowStart

    first, more = (files[0], tuple(files[1:])) if files else (None, ())
    return _run(WindowStart(scene, source_file=first, more_files=more, used=_used(room)))


def _used(room: str | None) -> tuple[Path, ...]:
    """Return the file of the room, for the list of recent files; nothing for a shipped room."""
    from sonarhw_sim.files import is_file

    return (Path(room),) if room is not None and is_file(room) else ()


def _scan(url: str, request: _Request, resume: bool = False, follows: bool = False) -> int:
    """Open the window on a scanner; `follows`: a fake one, which takes room and place of the plan for each scan."""
    from sonarhw_compare.scanner_url import is_fake
    from sonarhw_gui.window.display import DEMO, check_display

    fake = is_fake(url)
    takes_board = not fake and request.board is None
    request = replace(request, board=request.board or _board_of(url))
    scene = request.predicted(_fake_scene(url, request) if fake else _scene(request))
    check_display(DEMO if fake else f"`sonarhw scan {quote(url)} --out LOG.mcap` works without a window")
    from sonarhw_gui.window.start import WindowStart

    # a fake scanner may start at once; a real turntable must not move without a request
    start = WindowStart(scene, url=url, autostart=fake, takes_board=takes_board, resume=resume)
    return _run(replace(start, used=_used(request.room)), follows)


def _run(start: "WindowStart", follows: bool = False) -> int:
    """Show the window, with the scanner at its URL if there is one, and let it find others."""
    from sonarhw_gui.session.kept import memory_file
    from sonarhw_gui.window.start import run_window

    with ExitStack() as exit_stack:
        scanners = _Scanners(exit_stack)
        if start.url:
            start = replace(start, source=scanners.find(start.url, follows))
        return run_window(replace(start, find_scanner=scanners.find, memory=memory_file()))


def _board_of(url: str) -> str | None:
    """Return the board profile that suits the device of a plug-in, if known. Raises InputError for an invalid URL."""
    from sonarhw_sim.board.profile import board_names

    from sonarhw.plugins.device_plugin import is_plugin, make_plugin

    if not is_plugin(url):
        return None
    with make_plugin(url) as plugin:
        board = plugin.identity.board
    return board if board in board_names() else None


class _Scanners:
    """Scanners by URL. A fake scanner takes seconds to prepare, so the first scan starts it."""

    def __init__(self, exit_stack: ExitStack) -> None:
        self._exit_stack = exit_stack

    def find(self, url: str, follows: bool = False) -> "ScannerTarget":
        """Return the scanner at `url`, not yet opened. Raises InputError for an invalid URL.

        `follows`: it is a fake scanner that scans in the scene that the window shows.
        """
        from sonarhw_compare.scanner_url import is_fake
        from sonarhw_gui.session.scanner import ScannerTarget

        from sonarhw.plugins.device_plugin import is_plugin, make_plugin

        scene = _fake_scene(url, _NOTHING) if is_fake(url) else None
        if is_plugin(url):
            make_plugin(url).stop()  # an invalid URL is reported before a connection is made
        return ScannerTarget(url, self.opener(url), scene, partial(self.opener, url) if follows else None)

    def opener(self, url: str, scene: "Scene | None" = None) -> "ScannerOpener":
        """Return a function that opens the scanner at `url`. The function raises LinkError, DeviceError.

        `scene`: where a fake scanner is, instead of where its URL puts it.
        """
        served_urls: list[Find] = []

        def open_it() -> "Scanner":
            from sonarhw_compare.scanner_url import open_scanner, serve_fake_in

            from sonarhw.host.scanner import Scanner
            from sonarhw.plugins.device_plugin import is_plugin

            if is_plugin(url):
                return open_scanner(url)
            if not served_urls:
                self._exit_stack.close()  # ends an earlier fake scanner, whose connection is closed
                served = resolve(url)
                if scene is not None and scene.room is not None and scene.place is not None:
                    served = serve_fake_in(url, scene.room, scene.place, scene.board)
                served_urls.append(self._exit_stack.enter_context(served))
            name = url if scene is None else f"fake:{Path(scene.room_file).stem}?place={scene.pose.name}"
            return Scanner.open(name, find=served_urls[0])

        return open_it


def _scene(request: _Request, begin_at: str | None = None) -> "Scene":
    """Return the scene with the requested room, place and board.

    If no place is requested, a measured scan gets the place `begin_at` of its log, or else the first place of the room:
    the user can move the sensor or fit its place later. For a new scan `begin_at` is None. A place must then be
    requested if the room has several.
    """
    from sonarhw_gui.model.scene import first_place, scene_with
    from sonarhw_sim.board.profile import load_board
    from sonarhw_sim.files import file_name
    from sonarhw_sim.room.room import load_room, typed_place

    from sonarhw_cli.inputs import place_without_room

    board = load_board(request.board or DEFAULT_BOARD)
    if request.room is None:
        if request.place is None:
            return scene_with(board)
        return scene_with(board, place=typed_place(place_without_room(request.place)))
    room = load_room(request.room)
    if request.place is None and begin_at is not None:
        place = room.places.get(begin_at) or first_place(room)
    else:
        place = room.place(request.place)
    return scene_with(board, room, place, file_name(request.room))


def _fake_scene(url: str, request: _Request) -> "Scene":
    """Return the scene of the fake scanner, or that with the requested room. Check every part of the URL."""
    from sonarhw_compare.scanner_url import read_fake_url

    fake = read_fake_url(url)
    own = _Request(fake.room, fake.place, fake.board)
    scene = _scene(own)
    if scene.room is not None:
        scene = replace(scene, place=fake.place_in(scene.room))
    if request.room is None:
        request = replace(own, place=request.place or own.place, board=request.board or own.board)
    return scene if request == own else _scene(request)


def _log_scene(log: "Log", request: _Request) -> "Scene":
    from sonarhw_compare.scans import board_of_log
    from sonarhw_gui.model.scene import begin_of, scene_of_log
    from sonarhw_sim.board.profile import load_board
    from sonarhw_sim.room.room import typed_place

    from sonarhw_cli.inputs import place_without_room

    board = board_of_log(log.metadata) if request.board is None else load_board(request.board)
    if request.room is not None:
        scene = replace(_scene(replace(request, board=None), begin_at=log.metadata.place), board=board)
        first = begin_of(log.readings)
        return scene if request.place or log.metadata.place or first is None else replace(scene, place=first)
    scene = replace(scene_of_log(log.metadata, log.readings), board=board)
    if request.place is None:
        return scene
    if scene.room is None and typed_place(request.place) is None:
        raise InputError(f"--place {request.place}: the log contains no room; give one with --room, or write X,Y,DEG")
    if scene.room is None:
        return replace(scene, place=typed_place(place_without_room(request.place)))
    return replace(scene, place=scene.room.place(request.place))


# `sonarhw demo`: scan the demo room with a fake scanner, and show the scan over its prediction.


RESULT = "demo-result"  # folder of the demo's files when there is no display
OPTION = "--headless"
FILES = ("scan.mcap", "overlay.png", "summary.json")
STEP_DEGREES = 3.0


Headless = Annotated[
    Path | None,
    typer.Option(help=f"Without a window: write {FILES[0]}, {FILES[1]} and {FILES[2]} to DIR.", metavar="DIR"),
]


def demo(
    context: typer.Context,
    headless: Headless = None,
    force: ForceFiles = False,
) -> int:
    """Watch a fake scanner in the demo room (your own scanner: `scan`).

    The overlay is the scan drawn over its prediction. Without a display and without --headless, the files are written
    to a new folder: demo-result, or demo-result-2 and so on. The seed is fixed, so each run gives the same result.
    """
    if headless is None and _can_open_window():
        return show_demo()
    folder = _free_folder() if headless is None else headless
    refuse_existing_in(folder, [folder / name for name in FILES], force, OPTION)
    with made_folder(folder):
        _write_result(context, folder, force)
    return 0


def _free_folder() -> Path:
    names = (Path(RESULT if number == 1 else f"{RESULT}-{number}") for number in count(1))
    return next(name for name in names if not (name.exists() or name.is_symlink()))


def _can_open_window() -> bool:
    from sonarhw_gui.window.display import NoDisplay, check_display

    try:
        check_display()
    except NoDisplay:
        print_line("There is no display: the demo runs without a window.")
        return False
    except MissingExtra as error:
        print_line(f"The demo runs without a window: {error}")
        return False
    return True


def _write_result(context: typer.Context, folder: Path, force: bool) -> None:
    from sonarhw_compare.drawings import draw_comparison
    from sonarhw_compare.explain import summary_lines
    from sonarhw_compare.picture_file import write_picture
    from sonarhw_compare.scanner_url import DEMO_PLACE, DEMO_ROOM, demo_url

    from sonarhw_cli.compare import compare_log
    from sonarhw_cli.scan import scan

    log, picture, figures = (folder / name for name in FILES)
    scan(context, demo_url("max"), log, DEMO_ROOM, DEMO_PLACE, step=STEP_DEGREES, traces=True, force=force)
    comparison = compare_log(log, DEMO_ROOM, DEMO_PLACE)
    with atomic_file(picture, OPTION, overwrite=force) as file:
        write_picture(draw_comparison(comparison), file, picture.suffix)
    with atomic_file(figures, OPTION, overwrite=force) as file:
        file.write((json_text(asdict(comparison.summary()) | asdict(comparison.score)) + "\n").encode())
    for line in summary_lines(comparison.summary()):
        print_line(line)
    print_line(f"The picture is in {picture}, the scan in {log}, the summary in {figures}.")
