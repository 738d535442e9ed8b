"""Manual control of a scanner: `sonarhw home`, `turn`, `stop` and `monitor`."""

import math
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from sonarhw.errors import InputError, counted
from sonarhw.wire.messages import MOST_DEGREES
from sonarhw_cli.console.connect import ScannerUrl, connect_turntable, resolve
from sonarhw_cli.console.lines import print_line, print_note
from sonarhw_cli.console.options import ZeroHere, check_degrees

if TYPE_CHECKING:
    from sonarhw.link import Link
    from sonarhw.plugins.device_plugin import DevicePlugin
    from sonarhw.wire.frames import Frame, Rejected
    from sonarhw.wire.messages import Outcome

_MOST_JOG = 10.0  # degrees
_SHOWN = 24  # bytes of a rejected block


def home(url: ScannerUrl) -> None:
    """Find the zero of the turntable."""
    with connect_turntable(url) as scanner:
        outcome = scanner.home()
    print_note(f"{url}: {_ended(outcome, 'the turntable is at its zero')}")


Jog = Annotated[
    bool, typer.Option("--jog", help="Turn by DEG, at most 10 degrees, from the present angle, without homing.")
]


def turn(
    url: ScannerUrl,
    degrees: Annotated[float, typer.Argument(help="Turntable angle, degrees, counter-clockwise.", metavar="DEG")],
    zero_here: ZeroHere = False,
    jog: Jog = False,
) -> None:
    """Turn to an angle. If the zero of the turntable is unknown, it is found first."""
    if jog and zero_here:
        raise InputError("--jog, --zero-here: give only one of them")
    check_degrees("--jog" if jog else "DEG", degrees, _MOST_JOG if jog else MOST_DEGREES)
    with connect_turntable(url) as scanner:
        if zero_here:
            scanner.home(here=True)
        done = f"turned {'by' if jog else 'to'} {degrees:.1f}°"
        outcome = scanner.jog(math.radians(degrees)) if jog else scanner.turn(math.radians(degrees))
    print_note(f"{url}: {_ended(outcome, done)}")


def stop(url: ScannerUrl) -> None:
    """Stop turning and pinging."""
    with connect_turntable(url) as scanner:
        scanner.stop()
    print_note(f"{url}: stopped")


def _ended(outcome: "Outcome", done: str) -> str:
    """Return what an action did: `done`, or that it was stopped."""
    return "stopped before it had finished" if outcome else done


def monitor(url: ScannerUrl) -> None:
    """Print frames and rejected bytes as they arrive, until Ctrl-C. Their numbers follow at the end.

    The scanner is stopped first. Of a device that prints text, the received bytes and the readings in them are printed.
    """
    from sonarhw.link import Link
    from sonarhw.plugins.device_plugin import is_plugin, make_plugin

    if is_plugin(url):
        _monitor_plugin(make_plugin(url))
    with resolve(url) as find, Link(find()) as link:
        arrived = _Arrived()
        try:
            _show(link, arrived)
        finally:
            print_note(f"{url}: {arrived}")


def _monitor_plugin(plugin: "DevicePlugin") -> NoReturn:
    """Print what a plug-in reads, until Ctrl-C."""
    began, readings = time.monotonic(), 0
    received = bytearray()
    plugin.on_bytes = received.extend
    plugin.open()
    try:
        while True:
            measurements = plugin.read()
            now = f"{time.monotonic() - began:10.3f}"
            if received:
                print_line(f"{now}  {bytes(received)!r}")
                received.clear()
            for one in measurements:
                ranges = " ".join(f"{distance:.3f} m" for distance in one.ranges) or "no echo"
                print_line(f"{now}  {math.degrees(one.angle):.1f}°  {ranges}")
            readings += len(measurements)
    finally:
        plugin.close()
        ignored = "".join(f", {kind} ({count})" for kind, count in plugin.ignored.items() if count)
        print_note(f"{plugin.url}: {counted(readings, 'reading')}{ignored}")


@dataclass
class _Arrived:
    """The number of frames and rejected blocks since the start."""

    began: float = field(default_factory=time.monotonic)  # s
    frames: int = 0
    rejected: int = 0

    def __str__(self) -> str:
        after = f"in {self.seconds:.1f} s"
        if not self.frames:
            return f"no frame {after}, {counted(self.rejected, 'rejected block')}; check that this is a scanner"
        return f"{counted(self.frames, 'frame')} and {counted(self.rejected, 'rejected block')} {after}"

    @property
    def seconds(self) -> float:
        return time.monotonic() - self.began


def _show(link: "Link", arrived: _Arrived) -> NoReturn:
    from sonarhw.host.driver import SIGN_OF_LIFE
    from sonarhw.wire.frames import DELIMITER, Frame, FrameDecoder, encode_frame
    from sonarhw.wire.messages import PROTOCOL_MAJOR, PROTOCOL_MINOR, AskStatistics, Hello, Info, Message

    decoder = FrameDecoder()
    sequence, next_message, greeted = 0, arrived.began + link.quiet, False
    while True:
        now = time.monotonic()
        if now >= next_message:
            # a scanner that receives nothing releases its motor and stops sending
            sent: Message = AskStatistics() if greeted else Hello(PROTOCOL_MAJOR, PROTOCOL_MINOR)
            link.write(DELIMITER + encode_frame(Frame(sent.TYPE, sequence, 0, sent.pack())))
            sequence, next_message = (sequence + 1) % 0x10000, now + SIGN_OF_LIFE
        for item in decoder.feed(link.read()):
            if isinstance(item, Frame):
                greeted = greeted or item.type == Info.TYPE
                arrived.frames += 1
                shown = _described(item)
            else:
                arrived.rejected += 1
                shown = _rejected(item)
            print_line(f"{arrived.seconds:10.3f}  {shown}")


def _described(frame: "Frame") -> str:
    from sonarhw.wire.messages import MessageError, unpack_message

    try:
        content = unpack_message(frame.type, frame.payload)
    except MessageError as error:
        return f"#{frame.sequence} type 0x{frame.type:02x} malformed: {error}"
    what = content if content is not None else f"type 0x{frame.type:02x} unknown, payload {frame.payload.hex(' ')}"
    return f"#{frame.sequence} {frame.time_us / 1e6:.6f} s  {what}"


def _rejected(rejected: "Rejected") -> str:
    more = " ..." if len(rejected.block) > _SHOWN else ""
    return f"rejected {len(rejected.block)} bytes ({rejected.reason}): {rejected.block[:_SHOWN].hex(' ')}{more}"
