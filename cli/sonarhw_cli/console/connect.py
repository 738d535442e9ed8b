"""What a URL on the command line leads to: a port, a fake scanner in this process, or a log that plays as one.

Takes the URL as it was typed; hands on one that pyserial opens, or the opened scanner, for as long as the block lasts.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated
from urllib.parse import parse_qsl

import typer

from sonarhw.errors import InputError
from sonarhw_cli.console.options import DEFAULT_BOARD, chosen_place
from sonarhw_cli.console.room_input import open_room

if TYPE_CHECKING:
    from sonarhw_sim.predict.room_echoes import RoomEchoes

    from sonarhw.device.device import Device
    from sonarhw.device.endpoint import Pace
    from sonarhw.device.fault_schedule import Faults
    from sonarhw.host.scanner import Scanner

ScannerUrl = Annotated[
    str, typer.Argument(help="Serial port, socket://HOST:PORT, fake:ROOM?place=NAME&seed=1, or a log.", metavar="URL")
]
RECONNECT = 30.0  # s
Find = Callable[[], str]
LOOPBACK = "127.0.0.1:0"
FAKE = "fake:"
_FAKE_KEYS = ("place", "board", "seed", "pace", "faults")


@contextmanager
def connect(url: str, reconnect: float = RECONNECT) -> "Iterator[Scanner]":
    """The scanner at `url`, greeted; lost, it may come back within `reconnect` s.

    Raises InputError for a URL that says nothing, LinkError, DeviceError.
    """
    from sonarhw.host.scanner import Scanner

    with resolve(url) as find, Scanner.open(url, reconnect=reconnect, find=find) as scanner:
        yield scanner


@contextmanager
def resolve(url: str) -> Iterator[Find]:
    """What tells the URL that pyserial is to open now; what `fake:` and log files need runs in this process meanwhile.

    A device may come back under another name: ask again before each opening.
    """
    from sonarhw.link.ports import Whereabouts

    if url.startswith(FAKE):
        with _fake(url) as find:
            yield find
    elif Path(url).suffix == ".mcap":
        with _replay(Path(url)) as find:
            yield find
    else:
        yield Whereabouts(url)


def read_pace(text: str) -> "Pace":
    """The pace that `real`, `max` or a factor above 0 stands for. Raises InputError for anything else."""
    from sonarhw.device.endpoint import check_pace

    try:
        return check_pace(float(text))
    except ValueError:
        return check_pace(text)  # type: ignore[arg-type]  # whether it is one of the two words is what is checked


def fake_device(
    room_file: Path, place: str | None, board: str, seed: int, faults: "Faults"
) -> "tuple[Device, RoomEchoes]":
    """A fake board that hears the room in `room_file`, and its ears, on which `prepare` is to be called.

    Raises InputError where room, place or board is wrong.
    """
    from sonarhw_sim.board.profile import load_board

    room = open_room(room_file)
    here, profile = chosen_place(room, place), load_board(board)
    from sonarhw_sim.predict.room_echoes import RoomEchoes

    from sonarhw.device.fake_board import BoardIdentity, FakeBoard
    from sonarhw.device.fault_schedule import NO_FAULTS
    from sonarhw.device.faulty_board import FaultyDevice, afflicted

    echoes = RoomEchoes(room, here, profile, seed)
    identity = afflicted(BoardIdentity(serial=f"FAKE-{seed:04d}", profile=profile.name), faults)

    def switched_on(boots: int) -> FakeBoard:
        me = replace(identity, boot=1 + boots)
        return FakeBoard(echoes, seed, profile.listens_from, me, ready=lambda: echoes.ready)

    return switched_on(0) if faults == NO_FAULTS else FaultyDevice(switched_on, faults, seed), echoes


@dataclass(frozen=True)
class FakeUrl:
    """What a `fake:` URL asks for."""

    room_file: Path
    place: str | None
    board: str
    seed: int
    pace: "Pace"
    faults: "Faults"


def read_fake_url(url: str) -> FakeUrl:
    """The wishes in `fake:ROOM?place=NAME&seed=1`. Raises InputError for one that is not known or makes no sense."""
    from sonarhw.device.fault_schedule import read_faults

    room_file, _, query = url.removeprefix(FAKE).partition("?")
    if not room_file:
        raise InputError(f"{url}: names no room; expected fake:ROOM.toml?place=NAME")
    wishes = dict(parse_qsl(query, keep_blank_values=True))
    if unknown := sorted(set(wishes) - set(_FAKE_KEYS)):
        raise InputError(f"{url}: does not know {', '.join(unknown)}; known: {', '.join(_FAKE_KEYS)}")
    return FakeUrl(
        room_file=Path(room_file),
        place=wishes.get("place"),
        board=wishes.get("board", DEFAULT_BOARD),
        seed=read_seed(wishes.get("seed", "0")),
        pace=read_pace(wishes.get("pace", "real")),
        faults=read_faults(wishes.get("faults", "")),
    )


@contextmanager
def _fake(url: str) -> Iterator[Find]:
    from sonarhw.device.endpoint import serve

    wish = read_fake_url(url)
    _check_place(url, wish)
    device, echoes = fake_device(wish.room_file, wish.place, wish.board, wish.seed, wish.faults)
    echoes.prepare()
    with serve(device, tcp=LOOPBACK, pace=wish.pace) as endpoint:
        yield lambda: endpoint.url


def _check_place(url: str, wish: FakeUrl) -> None:
    from sonarhw_sim.room.model import load_room

    places = load_room(wish.room_file).places
    if wish.place is None and len(places) > 1:
        raise InputError(f"{url}: the room has several places; add ?place=NAME, one of {', '.join(places)}")


def read_seed(text: str) -> int:
    """The seed in a text. Raises InputError where it is no whole number from 0 up."""
    if not text.isdecimal():
        raise InputError(f"seed {text!r}: expected a whole number from 0 up")
    return int(text)


@contextmanager
def _replay(path: Path) -> Iterator[Find]:
    from sonarhw.device.endpoint import serve
    from sonarhw.replay.replayed_log import ReplayDevice
    from sonarhw_cli.console.log_input import open_log

    with serve(ReplayDevice(open_log(path)), tcp=LOOPBACK) as endpoint:
        yield lambda: endpoint.url
