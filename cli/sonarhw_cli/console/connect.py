"""URLs on the command line: a port, a fake scanner in this process, or a log that is replayed as a scanner."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated
from urllib.parse import parse_qsl

import typer
from sonarhw_sim.choices import DEFAULT_BOARD

from sonarhw.errors import InputError
from sonarhw_cli.console.options import chosen_place
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
    """Yield the connected scanner at `url`. After a loss, the driver tries to reconnect for up to `reconnect` s.

    Raises InputError for an invalid URL, LinkError, DeviceError.
    """
    from sonarhw.host.scanner import Scanner

    with resolve(url) as find, Scanner.open(url, reconnect=reconnect, find=find) as scanner:
        yield scanner


@contextmanager
def resolve(url: str) -> Iterator[Find]:
    """Yield a function that returns the URL to open with pyserial now.

    This process serves `fake:` URLs and log files until the block ends. Call the function before each opening,
    because a device may return under another name.
    """
    from sonarhw.link.ports import PortFinder

    if url.startswith(FAKE):
        with _fake(url) as find:
            yield find
    elif Path(url).suffix == ".mcap":
        with _replay(Path(url)) as find:
            yield find
    else:
        yield PortFinder(url)


def read_pace(text: str) -> "Pace":
    """Return the pace for `real`, `max` or a factor above 0. Raises InputError for anything else."""
    from sonarhw.device.endpoint import check_pace

    try:
        return check_pace(float(text))
    except ValueError:
        return check_pace(text)  # type: ignore[arg-type]  # check_pace accepts the two words only


def fake_device(
    room_file: Path, place: str | None, board: str, seed: int, faults: "Faults"
) -> "tuple[Device, RoomEchoes]":
    """Return a fake board in the room of `room_file`, and its echo source. Call `prepare` of the echo source.

    Raises InputError for an invalid room, place or board.
    """
    from sonarhw_sim.board.profile import load_board

    room = open_room(room_file)
    here, profile = chosen_place(room, place), load_board(board)
    from sonarhw_sim.predict.room_echoes import RoomEchoes

    from sonarhw.device.fake_board import BoardIdentity, FakeBoard
    from sonarhw.device.fault_schedule import NO_FAULTS
    from sonarhw.device.faulty_board import FaultyDevice, faulty_identity

    echoes = RoomEchoes(room, here, profile, seed)
    identity = faulty_identity(BoardIdentity(serial=f"FAKE-{seed:04d}", profile=profile.name), faults)

    def started(boots: int) -> FakeBoard:
        counted_identity = replace(identity, boot=1 + boots)
        return FakeBoard(echoes, seed, profile.blanking_end, counted_identity, ready=lambda: echoes.ready)

    return started(0) if faults == NO_FAULTS else FaultyDevice(started, faults, seed), echoes


@dataclass(frozen=True)
class FakeUrl:
    """The settings in a `fake:` URL."""

    room_file: Path
    place: str | None
    board: str
    seed: int
    pace: "Pace"
    faults: "Faults"


def read_fake_url(url: str) -> FakeUrl:
    """Return the settings in `fake:ROOM?place=NAME&seed=1`. Raises InputError for unknown keys or invalid values."""
    from sonarhw.device.fault_schedule import read_faults

    room_file, _, query = url.removeprefix(FAKE).partition("?")
    if not room_file:
        raise InputError(f"{url}: room file missing; expected fake:ROOM.toml?place=NAME")
    values = dict(parse_qsl(query, keep_blank_values=True))
    if unknown := sorted(set(values) - set(_FAKE_KEYS)):
        raise InputError(f"{url}: unknown key {', '.join(unknown)}; known: {', '.join(_FAKE_KEYS)}")
    return FakeUrl(
        room_file=Path(room_file),
        place=values.get("place"),
        board=values.get("board", DEFAULT_BOARD),
        seed=read_seed(values.get("seed", "0")),
        pace=read_pace(values.get("pace", "real")),
        faults=read_faults(values.get("faults", "")),
    )


@contextmanager
def _fake(url: str) -> Iterator[Find]:
    from sonarhw.device.endpoint import serve

    settings = read_fake_url(url)
    _check_place(url, settings)
    device, echoes = fake_device(settings.room_file, settings.place, settings.board, settings.seed, settings.faults)
    echoes.prepare()
    with serve(device, tcp=LOOPBACK, pace=settings.pace) as endpoint:
        yield lambda: endpoint.url


def _check_place(url: str, settings: FakeUrl) -> None:
    from sonarhw_sim.room.model import load_room

    places = load_room(settings.room_file).places
    if settings.place is None and len(places) > 1:
        raise InputError(f"{url}: the room has several places; add ?place=NAME, one of {', '.join(places)}")


def read_seed(text: str) -> int:
    """Return the seed in a text. Raises InputError unless it is a whole number, 0 or more."""
    if not text.isdecimal():
        raise InputError(f"seed {text!r}: expected a whole number, 0 or more")
    return int(text)


@contextmanager
def _replay(path: Path) -> Iterator[Find]:
    from sonarhw.device.endpoint import serve
    from sonarhw.replay.replayed_log import ReplayDevice
    from sonarhw_cli.console.log_input import open_log

    with serve(ReplayDevice(open_log(path)), tcp=LOOPBACK) as endpoint:
        yield lambda: endpoint.url
