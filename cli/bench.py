"""Bench work: `sonarhw home`, `turn`, `stop` and `monitor`."""

import math
import time
from typing import TYPE_CHECKING, Annotated

import typer

from cli.connect import ScannerUrl, connect, resolve
from cli.interruption import sigterm_raises
from cli.options import MOST_DEGREES
from sonarhw.errors import CommandRefused, InputError

if TYPE_CHECKING:
    from sonarhw.frames import Frame, Rejected

_SHOWN = 24  # bytes of a rejected stretch


def home(url: ScannerUrl) -> None:
    """Find the zero of the turntable."""
    with sigterm_raises(), connect(url) as scanner:
        scanner.home()


def turn(
    url: ScannerUrl,
    degrees: Annotated[float, typer.Argument(help="Turntable angle, counter-clockwise.", metavar="DEG")],
) -> None:
    """Turn to an angle, finding the zero first where the turntable does not know it."""
    from sonarhw.messages import Refusal

    if not abs(degrees) <= MOST_DEGREES:
        raise InputError(f"{degrees:g} degrees: expected an angle between -{MOST_DEGREES:g} and {MOST_DEGREES:g}")
    with sigterm_raises(), connect(url) as scanner:
        try:
            scanner.turn(math.radians(degrees))
        except CommandRefused as refused:
            if refused.code != Refusal.NOT_HOMED:
                raise
            scanner.home()
            scanner.turn(math.radians(degrees))


def stop(url: ScannerUrl) -> None:
    """Stop turning and pinging."""
    with sigterm_raises(), connect(url) as scanner:
        scanner.stop()


def monitor(url: ScannerUrl) -> None:
    """Greet the scanner, which stops it, and show decoded frames and rejected bytes as they come, until Ctrl-C."""
    from sonarhw.frames import DELIMITER, Frame, FrameDecoder, encode_frame
    from sonarhw.link import Link
    from sonarhw.messages import PROTOCOL_MAJOR, PROTOCOL_MINOR, Hello

    hello = Frame(Hello.TYPE, 0, 0, Hello(PROTOCOL_MAJOR, PROTOCOL_MINOR).pack())
    with sigterm_raises(), resolve(url) as target, Link(target) as link:
        link.write(DELIMITER + encode_frame(hello))
        decoder, began = FrameDecoder(), time.monotonic()
        while True:
            for item in decoder.feed(link.read()):
                seconds = time.monotonic() - began
                typer.echo(f"{seconds:10.3f}  {_described(item) if isinstance(item, Frame) else _rejected(item)}")


def _described(frame: "Frame") -> str:
    from sonarhw.messages import MessageError, unpack_message

    try:
        message = unpack_message(frame.type, frame.payload)
    except MessageError as error:
        return f"#{frame.sequence} type 0x{frame.type:02x} malformed: {error}"
    what = message if message is not None else f"type 0x{frame.type:02x} unknown, payload {frame.payload.hex(' ')}"
    return f"#{frame.sequence} {frame.time_us / 1e6:.6f} s  {what}"


def _rejected(rejected: "Rejected") -> str:
    more = " ..." if len(rejected.block) > _SHOWN else ""
    return f"rejected {len(rejected.block)} bytes ({rejected.reason}): {rejected.block[:_SHOWN].hex(' ')}{more}"
