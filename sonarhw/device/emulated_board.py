"""An emulated board that runs the real firmware, on a pseudo-terminal.

    with emulated_board(echoes) as board:
        Scanner.open(board.url)

The firmware runs in a separate process. An echo source supplies the echoes of its pings. The firmware itself sends
every byte that arrives at `url`. The board's time stops while the client has not read what the board has sent.
"""

import queue
import socket
import struct
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Literal

import numpy as np

from sonarhw.device.fake_board import WiringFault
from sonarhw.device.served import free_link, in_thread
from sonarhw.errors import InputError, LinkError
from sonarhw.readings import EchoSource, Ping, PingResult

BUILT = Path(__file__).parents[2] / "firmware" / "build"
LISTEN = 0.0655  # s; slightly above the longest listening time of the firmware
_READY_WITHIN = 60.0  # s, on a busy machine
_ENDS_WITHIN = 30.0  # s, on a busy machine
_HEADER = struct.Struct("<cI")
_PING = struct.Struct("<ddHB")


class EmulatedBoard:
    """A running board. Its methods may be called from any thread."""

    def __init__(self, process: "subprocess.Popen[bytes]", line: socket.socket, echoes: EchoSource) -> None:
        self._process, self._line, self._echoes = process, line, echoes
        self._writing = threading.Lock()
        self.fired = 0.0  # start of the current or last ping, s of the board's time
        self._cycles: queue.Queue[tuple[int, ...]] = queue.Queue()
        kind, name = self._message()
        if kind != b"U":
            raise LinkError("the emulated board did not start")
        self.url = name.decode()

    def reset(self) -> None:
        """Press the reset button."""
        self._send(b"R", b"")

    def hang(self) -> None:
        """Put the firmware into an endless loop, which its watchdog ends."""
        self._send(b"H", b"")

    def slip(self, microsteps: float) -> None:
        """Turn the table back by some microsteps, against the motor."""
        self._send(b"S", struct.pack("<d", microsteps))

    def miswire(self, faults: WiringFault) -> None:
        """Give the board these wiring faults."""
        self._send(b"M", struct.pack("<I", faults))

    def wedge(self, seconds: float) -> None:
        """Block the turntable for some seconds."""
        self._send(b"W", struct.pack("<d", seconds))

    def longest_interrupts(self) -> tuple[int, ...]:
        """Return the longest duration of the handler of each interrupt vector since the start, cycles."""
        self._send(b"C", b"")
        return self._cycles.get(timeout=_READY_WITHIN)

    def wait(self) -> int:
        """Wait until the process ends, and return its exit status."""
        return self._process.wait()

    def end(self) -> None:
        """Switch the board off."""
        self._process.terminate()
        # the emulator may be waiting for the echoes of a ping
        with suppress(OSError):
            self._line.shutdown(socket.SHUT_RDWR)

    def serve(self) -> None:
        """Answer pings until the process has ended. Errors of the echo source are raised."""
        while (message := self._next()) is not None:
            kind, payload = message
            if kind == b"P":
                degrees, self.fired, sweep, index = _PING.unpack(payload)
                result = self._echoes.receive(Ping(np.radians(degrees), sweep, index, LISTEN, True))
                with suppress(BrokenPipeError):  # the board may have been switched off
                    self._send(b"E", packed(result))
            elif kind == b"C":
                self._cycles.put(struct.unpack(f"<{len(payload) // 4}I", payload))

    def _next(self) -> tuple[bytes, bytes] | None:
        try:
            return self._message()
        except (EOFError, OSError):
            return None

    def _send(self, kind: bytes, payload: bytes) -> None:
        with self._writing:
            self._line.sendall(_HEADER.pack(kind, len(payload)) + payload)

    def _message(self) -> tuple[bytes, bytes]:
        kind, size = _HEADER.unpack(self._take(_HEADER.size))
        return kind, self._take(size)

    def _take(self, size: int) -> bytes:
        taken = b""
        while len(taken) < size:
            piece = self._line.recv(size - len(taken))
            if not piece:
                raise EOFError("the emulated board has ended")
            taken += piece
        return taken


def packed(result: PingResult) -> bytes:
    """Return the echoes and the trace of one ping in the format of the emulator."""
    times = struct.pack(f"<I{len(result.echo_times)}d", len(result.echo_times), *result.echo_times)
    if result.trace is None:
        return times + struct.pack("<ddI", 1.0, 0.0, 0)
    samples = np.nan_to_num(result.trace.samples).astype("<f4")
    return times + struct.pack("<ddI", result.trace.rate, result.trace.start, len(samples)) + samples.tobytes()


@contextmanager
def emulated_board(
    echoes: EchoSource,
    pty: Path | None = None,
    pace: float | Literal["real", "max"] = "real",
    start_deg: float = 100.0,
    eeprom: Path | None = None,
    built: Path = BUILT,
    combination: str = "mega-polaroid-step-dir",
    miswire: WiringFault | None = None,
    stall: float = 0.0,
) -> Iterator[EmulatedBoard]:
    """Run the firmware in the folder `built` for a combination of controller, ranging and turning until the block ends.

    `start_deg` is the angle of the turntable at power-on. `eeprom` is a file with the content of the EEPROM.
    `miswire` are wiring faults from power-on. Raises
    InputError if firmware or emulator is not built, and LinkError if the emulator does not start or ends by itself. It
    ends by itself if the firmware sends a byte or makes a step while it listens. An error of the echo source is raised
    at the end of the block.
    """
    image = built / (combination if combination.startswith("linux-") else f"{combination}.elf")
    for needed in (built / "emulator", image):
        if not needed.exists():
            raise InputError(f"{needed}: not built; run make firmware")
    if pty:
        free_link(pty)
    arguments: list[str | Path] = [built / "emulator", "--firmware", image]
    arguments += ["--combination", combination, "--stands", str(start_deg)]
    arguments += ["--pace", {"real": "1", "max": "0"}.get(str(pace), str(pace))]
    arguments += ["--temperature", str(echoes.temperature_c)] if echoes.temperature_c is not None else []
    arguments += ["--miswire", str(int(miswire))] if miswire else []
    arguments += ["--stall", str(stall)] if stall else []
    arguments += ["--eeprom", eeprom] if eeprom else []
    arguments += ["--link", pty] if pty else []
    with _started(arguments) as (process, line):
        try:
            board = EmulatedBoard(process, line, echoes)
        except (EOFError, OSError) as error:
            raise LinkError("the emulated board did not start; see its output above") from error
        line.settimeout(None)
        with in_thread(f"echoes for {board.url}", board.serve, board.end, board.end, _ENDS_WITHIN):
            yield board
        if process.wait(_ENDS_WITHIN):
            raise LinkError(f"the emulated board ended with exit status {process.returncode}; see its output above")


@contextmanager
def _started(arguments: list[str | Path]) -> Iterator[tuple["subprocess.Popen[bytes]", socket.socket]]:
    """Start the process, and yield it with the socket to it. The process ends with the block."""
    ours, its = socket.socketpair()
    ours.settimeout(_READY_WITHIN)
    command = [*arguments, "--parent", str(its.fileno())]
    with ours, subprocess.Popen(command, pass_fds=[its.fileno()], stdin=subprocess.DEVNULL) as process:
        its.close()
        try:
            yield process, ours
        finally:
            process.terminate()
            try:
                process.wait(_ENDS_WITHIN)
            except subprocess.TimeoutExpired:
                process.kill()
