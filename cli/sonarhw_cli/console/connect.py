"""Scanner URLs on the command line: connect to the scanner, with warnings on standard error."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, cast

import typer

from sonarhw.errors import InputError
from sonarhw_cli.console.lines import Verbosity, print_detail, prints, warn

if TYPE_CHECKING:
    from sonarhw_compare.one_call import Find
    from sonarhw_sim.board.profile import Board

    from sonarhw.host.scanner import ConnectedScanner, Scanner
    from sonarhw.plugins.plugin_scanner import PluginScanner

ScannerUrl = Annotated[
    str,
    typer.Argument(
        help="Serial port, socket://HOST:PORT, 'fake:ROOM?place=NAME&seed=1' (quoted), a log, or a device that prints "
        "text, 'lines:PORT?baud=9600&preset=NAME'.",
        metavar="URL",
    ),
]
RECONNECT = 30.0  # s
Reconnect = Annotated[float, typer.Option(help="Time for reconnecting to a lost scanner, seconds.", metavar="S", min=0)]


@contextmanager
def connect(url: str, reconnect: float = RECONNECT) -> "Iterator[Scanner | PluginScanner]":
    """Yield the connected scanner at `url`. After a loss, the driver tries to reconnect for up to `reconnect` s.

    Raises InputError for an invalid URL, LinkError, DeviceError.
    """
    from sonarhw_compare.one_call import open_scanner

    with open_scanner(url, reconnect=reconnect, warn=warn) as scanner:
        _print_fake(url)
        print_detail(f"{url}: scanner {scanner.info.serial or 'without serial number'}, {scanner.info.firmware}")
        yield scanner


@contextmanager
def connect_turntable(url: str) -> "Iterator[Scanner]":
    """Yield the connected scanner at `url`, whose turntable obeys commands. Raises what `connect` raises."""
    from sonarhw.plugins.device_plugin import is_plugin

    if is_plugin(url):
        raise InputError(f"{url}: this device obeys no commands to turn; `sonarhw scan` records its readings")
    with connect(url) as scanner:
        yield cast("Scanner", scanner)  # only the URLs of plug-ins give another class


def board_of(scanner: "ConnectedScanner", chosen: str | None) -> "Board":
    """Return the profile that --board names, else that of the scanner, else the default."""
    from sonarhw_sim.air import DEFAULT_BOARD
    from sonarhw_sim.board.profile import board_names, load_board

    named = scanner.info.board
    return load_board(chosen or (named if named in board_names() else DEFAULT_BOARD))


@contextmanager
def resolve(url: str) -> "Iterator[Find]":
    """Yield a function that returns the URL to open with pyserial now. Raises InputError for an invalid URL."""
    from sonarhw_compare import one_call

    with one_call.resolve(url, warn) as find:
        _print_fake(url)
        yield find


def _print_fake(url: str) -> None:
    """With --verbose, print room, place and board of a `fake:` URL."""
    from sonarhw_compare.one_call import is_fake, read_fake_url
    from sonarhw_sim.room.room import load_room

    if not (is_fake(url) and prints(Verbosity.VERBOSE)):
        return
    fake = read_fake_url(url)
    room = load_room(fake.room)
    print_detail(f"{url}: room {room.name!r}, place {fake.place_in(room).name!r}, board {fake.board!r}")
