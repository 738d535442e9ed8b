"""Fake scanners: `fake:ROOM?place=NAME&seed=1`, and the device that answers there."""

import math
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING
from urllib.parse import parse_qsl, urlencode

from sonarhw_sim.air import DEFAULT_BOARD
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.room.room import Place, Room, load_room, place_doubts, room_doubts

from sonarhw.device.fake_board import BoardIdentity, FakeBoard, Wires
from sonarhw.device.faults import NO_FAULTS, Faults, FaultyDevice, faulty_identity, read_faults
from sonarhw.device.protocol import Device
from sonarhw.device.served import Pace, read_pace, serve
from sonarhw.errors import InputError

if TYPE_CHECKING:
    from sonarhw_sim.predict.room_echoes import RoomEchoes

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
