"""Manual control of a scanner: `sonarhw home`, `turn`, `stop` and `monitor`."""

import math
import time
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from sonarhw.errors import InputError
from sonarhw_cli.console.connect import ScannerUrl, connect, resolve
from sonarhw_cli.console.interruption import sigterm_raises
from sonarhw_cli.console.options import MOST_DEGREES

if TYPE_CHECKING:
    from sonarhw.link.serial_link import Link
    from sonarhw.wire.frames import Frame, Rejected

_SHOWN = 24  # bytes of a rejected block


def home(url: ScannerUrl) -> None:
    """Find the zero of the turntable."""
    with sigterm_raises(), connect(url) as scanner:
        scanner.home()


def turn(
    url: ScannerUrl,
    degrees: Annotated[float, typer.Argument(help="Turntable angle, degrees, counter-clockwise.", metavar="DEG")],
) -> None:
    """Turn to an angle. If the zero of the turntable is unknown, it is found first."""
    if not abs(degrees) <= MOST_DEGREES:
        raise InputError(f"{degrees:g} degrees: expected an angle between -{MOST_DEGREES:g} and {MOST_DEGREES:g}")
    with sigterm_raises(), connect(url) as scanner:
        scanner.turn(math.radians(degrees))


def stop(url: ScannerUrl) -> None:
    """Stop turning and pinging."""
    with sigterm_raises(), connect(url) as scanner:
        scanner.stop()


def monitor(url: ScannerUrl) -> None:
    """Print frames and rejected bytes as they arrive, until Ctrl-C. The scanner is stopped first."""
    from sonarhw.link.serial_link import Link

    with sigterm_raises(), resolve(url) as find, Link(find()) as link:
        _show(link)


def _show(link: "Link") -> NoReturn:
    from sonarhw.host.driver import SIGN_OF_LIFE
    from sonarhw.wire.frames import DELIMITER, Frame, FrameDecoder, encode_frame
    from sonarhw.wire.limits import PROTOCOL_MAJOR, PROTOCOL_MINOR
    from sonarhw.wire.messages import AskStatistics, Hello, Info, Message

    decoder, began = FrameDecoder(), time.monotonic()
    sequence, next_message, greeted = 0, began + link.quiet, False
    while True:
        now = time.monotonic()
        if now >= next_message:
            # a scanner that receives nothing releases its motor and stops sending
            message: Message = AskStatistics() if greeted else Hello(PROTOCOL_MAJOR, PROTOCOL_MINOR)
            link.write(DELIMITER + encode_frame(Frame(message.TYPE, sequence, 0, message.pack())))
            sequence, next_message = (sequence + 1) % 0x10000, now + SIGN_OF_LIFE
        for item in decoder.feed(link.read()):
            greeted = greeted or (isinstance(item, Frame) and item.type == Info.TYPE)
            seconds = time.monotonic() - began
            typer.echo(f"{seconds:10.3f}  {_described(item) if isinstance(item, Frame) else _rejected(item)}")


def _described(frame: "Frame") -> str:
    from sonarhw.wire.messages import MessageError, unpack_message

    try:
        message = unpack_message(frame.type, frame.payload)
    except MessageError as error:
        return f"#{frame.sequence} type 0x{frame.type:02x} malformed: {error}"
    what = message if message is not None else f"type 0x{frame.type:02x} unknown, payload {frame.payload.hex(' ')}"
    return f"#{frame.sequence} {frame.time_us / 1e6:.6f} s  {what}"


def _rejected(rejected: "Rejected") -> str:
    more = " ..." if len(rejected.block) > _SHOWN else ""
    return f"rejected {len(rejected.block)} bytes ({rejected.reason}): {rejected.block[:_SHOWN].hex(' ')}{more}"
