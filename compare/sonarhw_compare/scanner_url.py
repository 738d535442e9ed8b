"""Scanners at any URL: `open_scanner` of `sonarhw`, and the fake scanners that answer at `fake:` URLs."""

import math
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias
from urllib.parse import parse_qsl

from sonarhw_sim.air import DEFAULT_BOARD
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.room.room import Place, Room, load_room, place_doubts, room_doubts

from sonarhw import arguments
from sonarhw.arguments import Warn, emit
from sonarhw.device.fake_board import BoardIdentity, FakeBoard, Wires
from sonarhw.device.faults import NO_FAULTS, Faults, FaultyDevice, faulty_identity, read_faults
from sonarhw.device.protocol import Device
from sonarhw.device.replayed_log import ReplayDevice
from sonarhw.device.served import Pace, read_pace, serve
from sonarhw.errors import InputError, did_you_mean
from sonarhw.host.scanner import Scanner
from sonarhw.host.session import PATIENCE, RECONNECT, Recorder
from sonarhw.link import PortFinder
from sonarhw.log import read_log
from sonarhw.plugins.device_plugin import is_plugin, make_plugin
from sonarhw.plugins.plugin_device import PluginLink

if TYPE_CHECKING:
    from sonarhw_sim.predict.room_echoes import RoomEchoes


# Fake scanners: `fake:ROOM?place=NAME&seed=1`, and the device that answers there.


LOOPBACK = "127.0.0.1:0"
SCHEME = "fake"
_SEED_DIGITS = 18
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


def read_fake_url(url: str) -> FakeUrl:
    """Return the settings in `fake:ROOM?place=NAME&seed=1`. Raises InputError for unknown keys or invalid values."""
    room, _, query = url.removeprefix(f"{SCHEME}:").partition("?")
    if room in ("", SCHEME):
        raise InputError(f"{url}: room missing; expected 'fake:NAME?place=NAME' or 'fake:FILE.toml?place=NAME'")
    if not query and "&" in room and "=" in room:
        raise InputError(f"{url}: write ? before the first key; did you mean '{url.replace('&', '?', 1)}'?")
    values = dict(parse_qsl(query, keep_blank_values=True))
    if unknown := sorted(set(values) - set(_KEYS)):
        hint = did_you_mean(unknown[0], _KEYS) or ";"
        raise InputError(f"{url}: unknown key {', '.join(unknown)}{hint} known: {', '.join(_KEYS)}")
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
    with serve_fake_in(url, room, place, load_board(settings.board)) as find:
        yield find


@contextmanager
def serve_fake_in(url: str, room: Room, place: Place, board: Board) -> Iterator[Callable[[], str]]:
    """Serve the fake scanner of a URL with its seed, pace and faults, but at this place and with this board.

    Yields a function that returns its present URL.
    """
    settings = read_fake_url(url)
    device, _ = fake_device(room, place, board, settings.seed, settings.faults)
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
    # a part of the serial number, which has a length in the protocol
    if not text.isdecimal() or len(text) > _SEED_DIGITS:
        raise InputError(f"seed {text[:30]!r}: expected a whole number, 0 or more, of at most {_SEED_DIGITS} digits")
    return int(text)


# The demo: a shipped room, a place in it, and the URL of the fake scanner there.


DEMO_ROOM = "laboratory"
DEMO_PLACE = "bench"
_DEMO_SEED = 1


def demo_url(pace: str = "real") -> str:
    """Return the URL of the fake scanner in the demo room."""
    return f"{SCHEME}:{DEMO_ROOM}?place={DEMO_PLACE}&seed={_DEMO_SEED}&pace={pace}"


# Open a scanner at any URL: `open_scanner` of `sonarhw`.
#
# To add a scheme for a device that speaks the wire protocol, add a line to SCHEMES: the function that makes the
# scanner of a URL available. For any other device, write a plug-in (`sonarhw.plugins.device_plugin`).


Find: TypeAlias = Callable[[], str]  # returns the URL to open with pyserial now

# by scheme: makes a scanner available until the end of the block; other URLs are opened by pyserial
SCHEMES: dict[str, Callable[[str, Warn], AbstractContextManager[Find]]] = {SCHEME: serve_fake}


@arguments.checked(
    url=arguments.text,
    patience=arguments.number(0, unit="s"),
    reconnect=arguments.number(0, unit="s"),
    warn=arguments.function,
)
def open_scanner(
    url: str,
    *,
    recorder: Recorder | None = None,
    patience: float = PATIENCE,
    reconnect: float = RECONNECT,
    warn: Warn = emit,
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
def resolve(url: str, warn: Warn = emit) -> Iterator[Find]:
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


def check_turns(url: str) -> None:
    """Raise InputError for the URL of a device that turns by itself and obeys no commands."""
    if is_plugin(url):
        raise InputError(f"{url}: this device obeys no commands to turn; `sonarhw scan` records its readings")
