"""`sonarhw gui`: the window, on a log, on a scanner, or on the demo."""

from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cli.connect import FAKE, Find, read_fake_url, resolve
from cli.demo_room import demo_room, demo_url
from cli.options import DEFAULT_BOARD, PlaceName
from sonarhw.errors import InputError

if TYPE_CHECKING:
    from gui.live_scan import ScannerOpener
    from gui.scanner_choice import ScannerWay
    from gui.scene import Scene
    from sonarhw.log import Log, LogMetadata
    from sonarhw.scanner import Scanner


@dataclass(frozen=True)
class _Wish:
    """What the person asked for besides the source."""

    room: Path | None
    place: str | None
    board: str | None


_NOTHING = _Wish(None, None, None)


def gui(
    source: Annotated[
        str | None,
        typer.Argument(help="Log, serial port, socket://HOST:PORT or fake:ROOM?place=NAME.", metavar="LOG|URL"),
    ] = None,
    room: Annotated[Path | None, typer.Option(help="Room file; default: the one in the log.", metavar="ROOM")] = None,
    place: PlaceName = None,
    board: Annotated[
        str | None, typer.Option(help="Board profile; default: the log's own.", metavar="NAME|FILE.toml")
    ] = None,
) -> int:
    """Open the window: scan live or replay a log; without LOG or URL as it was left, the first time on the demo."""
    wish = _Wish(room, place, board)
    if source is not None and _is_log(source):
        return _replay(Path(source), wish)
    if source is not None:
        return _scan(source, wish)
    with demo_room() as room_file:
        return _scan(demo_url(room_file), wish, resume=wish == _NOTHING)


def show_demo() -> int:
    """Open the window on a fake scanner in the demo room."""
    with demo_room() as room_file:
        return _scan(demo_url(room_file), _NOTHING)


def _is_log(source: str) -> bool:
    return Path(source).suffix == ".mcap" and not source.startswith(FAKE)


def _replay(path: Path, wish: _Wish) -> int:
    from cli.log_input import open_log
    from gui.display import check_display

    log = open_log(path)
    scene = _log_scene(log, wish)
    check_display()
    from gui.app import WindowStart, run_window
    from gui.memory import memory_file

    with ExitStack() as during:
        ways = _Ways(during)
        return run_window(
            WindowStart(scene, log, source_name=path.name, source_file=path, find_way=ways.find, memory=memory_file())
        )


def _scan(url: str, wish: _Wish, resume: bool = False) -> int:
    from gui.display import check_display

    fake = url.startswith(FAKE)
    scene = _fake_scene(url, wish) if fake else _scene(wish)
    check_display()
    from gui.app import WindowStart, run_window
    from gui.memory import memory_file

    with ExitStack() as during:
        ways = _Ways(during)
        # a fake may begin at once; a turntable that is there moves only when somebody says so
        start = WindowStart(scene, ways.opener(url), autostart=fake, url=url, find_way=ways.find, memory=memory_file())
        return run_window(replace(start, resume=resume))


class _Ways:
    """The ways to scanners: what a URL needs is started by the first scan, for a fake takes seconds to get ready."""

    def __init__(self, during: ExitStack) -> None:
        self._during = during

    def find(self, url: str) -> "ScannerWay":
        """The way to the scanner at `url`; nothing is opened yet. Raises InputError where it says nothing."""
        from gui.scanner_choice import ScannerWay

        scene = _fake_scene(url, _NOTHING) if url.startswith(FAKE) else None
        return ScannerWay(url, self.opener(url), scene)

    def opener(self, url: str) -> "ScannerOpener":
        """What opens the scanner at `url` and greets it. It raises LinkError, DeviceError."""
        found: list[Find] = []

        def open_it() -> "Scanner":
            from sonarhw.scanner import Scanner

            if not found:
                found.append(self._during.enter_context(resolve(url)))
            return Scanner.open(found[0](), find=found[0])

        return open_it


def _scene(wish: _Wish) -> "Scene":
    from gui.scene import Scene
    from sim.board import load_board
    from sim.room import load_room

    board = load_board(wish.board or DEFAULT_BOARD)
    if wish.room is None:
        if wish.place is not None:
            raise InputError("--place needs --room: it is a place of a room file")
        return Scene(None, None, board)
    room = load_room(wish.room)
    return Scene(room, room.place(wish.place), board, wish.room.name)


def _fake_scene(url: str, wish: _Wish) -> "Scene":
    """The room that the fake hears, unless another one is asked for; every part of the URL is checked."""
    fake = read_fake_url(url)
    heard = _Wish(fake.room_file, fake.place, fake.board)
    scene = _scene(heard)
    if wish.room is None:
        wish = replace(heard, place=wish.place or heard.place, board=wish.board or heard.board)
    return scene if wish == heard else _scene(wish)


def _log_scene(log: "Log", wish: _Wish) -> "Scene":
    from compare.recorded_board import board_of_log
    from gui.scene import scene_of_log
    from sim.board import load_board

    board = board_of_log(log.metadata) if wish.board is None else load_board(wish.board)
    if wish.room is not None:
        place = wish.place or _same_place(log.metadata, wish.room)
        return replace(_scene(replace(wish, place=place, board=None)), board=board)
    scene = replace(scene_of_log(log.metadata), board=board)
    if wish.place is None:
        return scene
    if scene.room is None:
        raise InputError(f"--place {wish.place}: the log carries no room; give one with --room")
    return replace(scene, place=scene.room.place(wish.place))


def _same_place(metadata: "LogMetadata", room_file: Path) -> str | None:
    """The place that the log names, where the room that was given has it too."""
    from sim.room import load_room

    return metadata.place if metadata.place in load_room(room_file).places else None
