"""The board that is not there: the real firmware, emulated, on a pseudo-terminal.

    with emulated_board(echoes) as board:
        Scanner.open(board.url)

Takes an echo source; owns the process in which the firmware runs and answers its pings. What is on the other side of
`url` is the firmware itself: every byte comes from its code.
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

from sonarhw.echo_source import EchoSource, Ping, PingResult
from sonarhw.errors import InputError, LinkError

BUILT = Path(__file__).parents[2] / "firmware" / "build"
LISTEN = 0.0655  # s; a little longer than the firmware can
_READY_WITHIN = 60.0  # s, on a busy machine
_ENDS_WITHIN = 30.0  # s, on a busy machine
_HEADER = struct.Struct("<cI")
_PING = struct.Struct("<ddHB")


class EmulatedBoard:
    """A running board. Its methods may be called from any thread."""

    def __init__(self, process: "subprocess.Popen[bytes]", line: socket.socket, echoes: EchoSource) -> None:
        self._process, self._line, self._echoes = process, line, echoes
        self._writing = threading.Lock()
        self.fired = 0.0  # when the ping under way, or the last one, began: s of the board's time
        self._cycles: queue.Queue[tuple[int, ...]] = queue.Queue()
        kind, name = self._message()
        if kind != b"U":
            raise LinkError("the emulated board did not start")
        self.url = name.decode()

    def reset(self) -> None:
        """Press the reset button."""
        self._tell(b"R", b"")

    def hang(self) -> None:
        """Let the firmware run in a circle, which its watchdog ends."""
        self._tell(b"H", b"")

    def slip(self, microsteps: float) -> None:
        """Turn the table back by hand, against the motor."""
        self._tell(b"S", struct.pack("<d", microsteps))

    def wedge(self, seconds: float) -> None:
        """Hold the table for a while."""
        self._tell(b"W", struct.pack("<d", seconds))

    def longest_interrupts(self) -> tuple[int, ...]:
        """How many cycles the handler of each interrupt vector took at most since the start."""
        self._tell(b"C", b"")
        return self._cycles.get(timeout=_READY_WITHIN)

    def wait(self) -> int:
        """Wait until it ends; its exit status."""
        return self._process.wait()

    def end(self) -> None:
        """Switch it off."""
        self._process.terminate()
        # it may be waiting for an answer
        with suppress(OSError):
            self._line.shutdown(socket.SHUT_RDWR)

    def serve(self) -> None:
        """Answer pings until the board has gone. Raises what the echo source does."""
        while (message := self._next()) is not None:
            kind, payload = message
            if kind == b"P":
                degrees, self.fired, sweep, index = _PING.unpack(payload)
                heard = self._echoes.receive(Ping(np.radians(degrees), sweep, index, LISTEN, True))
                with suppress(BrokenPipeError):  # it may have been switched off meanwhile
                    self._tell(b"E", packed(heard))
            elif kind == b"C":
                self._cycles.put(struct.unpack(f"<{len(payload) // 4}I", payload))

    def _next(self) -> tuple[bytes, bytes] | None:
        try:
            return self._message()
        except (EOFError, OSError):
            return None

    def _tell(self, kind: bytes, payload: bytes) -> None:
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
                raise EOFError("the emulated board has gone")
            taken += piece
        return taken


def packed(heard: PingResult) -> bytes:
    """What one ping brought back, as the emulator reads it."""
    times = struct.pack(f"<I{len(heard.echo_times)}d", len(heard.echo_times), *heard.echo_times)
    if heard.trace is None:
        return times + struct.pack("<ddI", 1.0, 0.0, 0)
    samples = np.nan_to_num(heard.trace.samples).astype("<f4")
    return times + struct.pack("<ddI", heard.trace.rate, heard.trace.start, len(samples)) + samples.tobytes()


@contextmanager
def emulated_board(
    echoes: EchoSource,
    pty: Path | None = None,
    pace: float | Literal["real", "max"] = "real",
    stands_deg: float = 100.0,
    eeprom: Path | None = None,
    built: Path = BUILT,
) -> Iterator[EmulatedBoard]:
    """The firmware built in `built`, running until the block ends.

    `stands_deg` is where the table stands at power-on; `eeprom` a file that keeps what outlives a power cut. Raises
    InputError where firmware or emulator is not built, LinkError where it does not start or ended by itself (it does so
    where the firmware sends or steps while it listens), and at the end of the block what went wrong in the echo source.
    """
    for needed in (built / "emulator", built / "sonar.elf"):
        if not needed.exists():
            raise InputError(f"{needed}: not built; run make firmware")
    arguments: list[str | Path] = [built / "emulator", "--firmware", built / "sonar.elf", "--stands", str(stands_deg)]
    arguments += ["--pace", {"real": "1", "max": "0"}.get(str(pace), str(pace))]
    arguments += ["--temperature", str(echoes.temperature_c)] if echoes.temperature_c is not None else []
    arguments += ["--eeprom", eeprom] if eeprom else []
    arguments += ["--link", pty] if pty else []
    with _started(arguments) as (process, line):
        try:
            board = EmulatedBoard(process, line, echoes)
        except (EOFError, OSError) as error:
            raise LinkError("the emulated board did not start; what it said stands above") from error
        line.settimeout(None)
        with _served(board):
            yield board
        if process.wait(_ENDS_WITHIN):
            raise LinkError(f"the emulated board ended with {process.returncode}; what it said stands above")


@contextmanager
def _started(arguments: list[str | Path]) -> Iterator[tuple["subprocess.Popen[bytes]", socket.socket]]:
    """The process and the line to it; ended with the block."""
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


@contextmanager
def _served(board: EmulatedBoard) -> Iterator[None]:
    failures: list[BaseException] = []

    def run() -> None:
        try:
            board.serve()
        except BaseException as failure:  # noqa: BLE001 - raised again in the thread that asked for the board
            failures.append(failure)
            board.end()

    thread = threading.Thread(target=run, name=f"echoes for {board.url}", daemon=True)
    thread.start()
    try:
        yield
    finally:
        board.end()
        thread.join(_ENDS_WITHIN)
    if failures:
        raise failures[0]
