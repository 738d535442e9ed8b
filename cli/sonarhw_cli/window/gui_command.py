"""`sonarhw gui`: the window, on a log, on a scanner, or on the demo."""

from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sonarhw.errors import InputError
from sonarhw_cli.console.connect import FAKE, Find, read_fake_url, resolve
from sonarhw_cli.console.demo_room import demo_room, demo_url
from sonarhw_cli.console.options import DEFAULT_BOARD, LOG, PlaceName

if TYPE_CHECKING:
    from sonarhw_gui.live.scanner_jobs import ScannerOpener
    from sonarhw_gui.scene.scene import Scene
    from sonarhw_gui.session.scanner_choice import ScannerTarget

    from sonarhw.host.scanner import Scanner
    from sonarhw.log import Log


_SCAN, _ROOM = ".csv", ".toml"


@dataclass(frozen=True)
class _Wish:
    """What the person asked for besides the source."""

    room: Path | None
    place: str | None
    board: str | None


_NOTHING = _Wish(None, None, None)


def gui(
    sources: Annotated[
        list[str] | None,
        typer.Argument(
            help="Log, scan as CSV, serial port, socket://HOST:PORT or fake:ROOM?place=NAME; with or without a room.",
            metavar="LOG|CSV|URL|ROOM",
        ),
    ] = None,
    room: Annotated[Path | None, typer.Option(help="Room file; default: the one in the log.", metavar="ROOM")] = None,
    place: PlaceName = None,
    board: Annotated[
        str | None, typer.Option(help="Board profile; default: the log's own.", metavar="NAME|FILE.toml")
    ] = None,
) -> int:
    """Open the window: scan live or replay a log; with nothing named as it was left, the first time on the demo."""
    source, room_named = _sorted_out(sources or [], room)
    wish = _Wish(room or room_named, place, board)
    if source is not None and _kind(source) == LOG:
        return _replay(Path(source), wish)
    if source is not None and _kind(source) == _SCAN:
        return _show_foreign(Path(source), wish)
    if source is not None:
        return _scan(source, wish)
    if room_named is not None:
        return _show_room(room_named, wish)
    with demo_room() as room_file:
        return _scan(demo_url(room_file), wish, resume=wish == _NOTHING)


def show_demo() -> int:
    """Open the window on a fake scanner in the demo room."""
    with demo_room() as room_file:
        return _scan(demo_url(room_file), _NOTHING)


def _sorted_out(sources: list[str], room: Path | None) -> tuple[str | None, Path | None]:
    """What is to be seen, and the room named beside it. Raises InputError for several of one kind, or of no kind."""
    rooms = [source for source in sources if _kind(source) == _ROOM]
    others = [source for source in sources if source not in rooms]
    if len(others) > 1:
        raise InputError(f"{' '.join(others)}: expected one log, scan or scanner at a time")
    if len(rooms) + (room is not None) > 1:
        raise InputError(f"{' '.join([*rooms, *([f'--room {room}'] if room else [])])}: expected one room")
    return (others[0] if others else None), (Path(rooms[0]) if rooms else None)


def _kind(source: str) -> str:
    """The ending of the name of a file that can be opened; empty for a URL. Raises InputError for another file."""
    if source.startswith(FAKE) or "://" in source:
        return ""
    path = Path(source)
    if path.suffix.lower() in (LOG, _SCAN, _ROOM):
        return path.suffix.lower()
    if path.is_file() or path.is_dir():
        raise InputError(
            f"{source}: expected a log (*{LOG}), a scan as *{_SCAN}, a room (*{_ROOM}) or the URL of a scanner"
        )
    return ""


def _replay(path: Path, wish: _Wish) -> int:
    from sonarhw_gui.shell.display import check_display

    from sonarhw_cli.console.log_input import open_log

    log = open_log(path)
    scene = _log_scene(log, wish)
    check_display()
    from sonarhw_gui.session.memory import memory_file
    from sonarhw_gui.shell.application import WindowStart, run_window

    with ExitStack() as during:
        ways = _Ways(during)
        start = WindowStart(scene, log, source_name=path.name, source_file=path, used=_used(wish.room, path))
        return run_window(replace(start, find_scanner=ways.find, memory=memory_file()))


def _show_foreign(path: Path, wish: _Wish) -> int:
    from sonarhw_compare.imports.foreign_csv import guess_columns, read_foreign_scan

    scene = _scene(wish, begin_at="")
    read_foreign_scan(path, *guess_columns(path))  # refused here where nothing can be meant
    return _show(scene, wish.room, path)


def _show_room(path: Path, wish: _Wish) -> int:
    return _show(_scene(wish, begin_at=""), path)


def _show(scene: "Scene", room: Path | None, file: Path | None = None) -> int:
    """The window on a scene without a scanner, and the file that it opens there."""
    from sonarhw_gui.shell.display import check_display

    check_display()
    from sonarhw_gui.session.memory import memory_file
    from sonarhw_gui.shell.application import WindowStart, run_window

    with ExitStack() as during:
        find_scanner = _Ways(during).find
        start = WindowStart(scene, source_file=file, used=_used(room), find_scanner=find_scanner, memory=memory_file())
        return run_window(start)


def _used(*named: Path | None) -> tuple[Path, ...]:
    return tuple(path for path in named if path is not None)


def _scan(url: str, wish: _Wish, resume: bool = False) -> int:
    from sonarhw_gui.shell.display import check_display

    fake = url.startswith(FAKE)
    scene = _fake_scene(url, wish) if fake else _scene(wish)
    check_display()
    from sonarhw_gui.session.memory import memory_file
    from sonarhw_gui.shell.application import WindowStart, run_window

    with ExitStack() as during:
        ways = _Ways(during)
        # a fake may begin at once; a turntable that is there moves only when somebody says so
        start = WindowStart(
            scene, ways.opener(url), autostart=fake, url=url, find_scanner=ways.find, memory=memory_file()
        )
        return run_window(replace(start, resume=resume, used=_used(wish.room)))


class _Ways:
    """The ways to scanners: what a URL needs is started by the first scan, for a fake takes seconds to get ready."""

    def __init__(self, during: ExitStack) -> None:
        self._during = during

    def find(self, url: str) -> "ScannerTarget":
        """The way to the scanner at `url`; nothing is opened yet. Raises InputError where it says nothing."""
        from sonarhw_gui.session.scanner_choice import ScannerTarget

        scene = _fake_scene(url, _NOTHING) if url.startswith(FAKE) else None
        return ScannerTarget(url, self.opener(url), scene)

    def opener(self, url: str) -> "ScannerOpener":
        """What opens the scanner at `url` and greets it. It raises LinkError, DeviceError."""
        found: list[Find] = []

        def open_it() -> "Scanner":
            from sonarhw.host.scanner import Scanner

            if not found:
                found.append(self._during.enter_context(resolve(url)))
            return Scanner.open(url, find=found[0])

        return open_it


def _scene(wish: _Wish, begin_at: str | None = None) -> "Scene":
    """The scene that is asked for.

    A window shows what was measured from there and can look for the true place, so it may `begin_at` one that nobody
    asked for: that of the log, if the room has it, else the room's first. A scan that is to come must be told (None).
    """
    from sonarhw_gui.scene.scene import first_place, scene_with
    from sonarhw_sim.board.profile import load_board
    from sonarhw_sim.room.model import load_room

    board = load_board(wish.board or DEFAULT_BOARD)
    if wish.room is None:
        if wish.place is not None:
            raise InputError("--place needs --room: it is a place of a room file")
        return scene_with(board)
    room = load_room(wish.room)
    if wish.place is None and begin_at is not None:
        place = room.places.get(begin_at) or first_place(room)
    else:
        place = room.place(wish.place)
    return scene_with(board, room, place, wish.room.name)


def _fake_scene(url: str, wish: _Wish) -> "Scene":
    """The room that the fake hears, unless another one is asked for; every part of the URL is checked."""
    fake = read_fake_url(url)
    heard = _Wish(fake.room_file, fake.place, fake.board)
    scene = _scene(heard)
    if wish.room is None:
        wish = replace(heard, place=wish.place or heard.place, board=wish.board or heard.board)
    return scene if wish == heard else _scene(wish)


def _log_scene(log: "Log", wish: _Wish) -> "Scene":
    from sonarhw_compare.imports.recorded_board import board_of_log
    from sonarhw_gui.scene.scene import scene_of_log
    from sonarhw_sim.board.profile import load_board

    board = board_of_log(log.metadata) if wish.board is None else load_board(wish.board)
    if wish.room is not None:
        return replace(_scene(replace(wish, board=None), begin_at=log.metadata.place), board=board)
    scene = replace(scene_of_log(log.metadata), board=board)
    if wish.place is None:
        return scene
    if scene.room is None:
        raise InputError(f"--place {wish.place}: the log carries no room; give one with --room")
    return replace(scene, place=scene.room.place(wish.place))
