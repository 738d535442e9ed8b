"""A board with an emulated bootloader on a pseudo-terminal: STK500, version 2 as on a Mega 2560, 1 as on an Uno.

The bootloader starts at its first message, as after a reset. It ends as the real one does, and the board then runs the
firmware that was written.
"""

import os
import pty
import select
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager

from sonarhw.device.fake_board import BoardIdentity, FakeBoard
from tests.fixtures.plain_echoes import PlainEchoes

SIGNATURES = {"atmega2560": b"\x1e\x98\x01", "atmega328p": b"\x1e\x95\x0f"}
_START, _TOKEN = 0x1B, 0x0E
_LEAVE = 0x11
_START_1, _LEAVE_1, _IN_STEP, _DONE = 0x30, 0x51, b"\x14", b"\x10"  # of version 1
_SIZES_1 = {0x41: 3, 0x42: 22, 0x55: 4, 0x56: 6, 0x74: 5}  # bytes of a message; the others 2
PARTS = ("polaroid-6500", "step-dir")  # profile and turntable


class BootloaderBoard:
    """The board. `firmware` runs before it is flashed; empty: nothing that answers."""

    def __init__(
        self,
        firmware: str,
        chip: str = "atmega2560",
        writes: bool = True,
        parts: tuple[str, str] = PARTS,
        before: tuple[str, str] = PARTS,
    ) -> None:
        """A board that does not keep what is written has `writes` False.

        `parts` are the profile and the turntable in the answers of the flashed firmware, `before` those of the old one.
        """
        self.flash = bytearray(b"\xff" * 0x40000)
        self.flashed = False
        self._signature, self._writes = SIGNATURES[chip], writes
        self._device = _running(firmware, *before) if firmware else None
        name = "sonarhw-mega 0.1.0" if chip == "atmega2560" else "sonarhw-uno 0.1.0"
        self._flashed_firmware = (name, *parts)
        self._address = 0
        self._waiting = bytearray()
        self._booting = self._version_1 = False
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self._ended = threading.Event()

    def run(self) -> None:
        """Serve the port until `end`."""
        while not self._ended.is_set():
            if select.select([self._master], [], [], 0.01)[0]:
                self._receive(os.read(self._master, 4096))
            if self._device and not self._booting and (sent := self._device.advance(time.monotonic())):
                os.write(self._master, sent)

    def end(self) -> None:
        """End `run`."""
        self._ended.set()

    def close(self) -> None:
        """Close the port."""
        os.close(self._master)
        os.close(self._slave)

    def _receive(self, data: bytes) -> None:
        if not self._booting and data[:1] in (bytes([_START]), bytes([_START_1])):
            self._booting, self._version_1 = True, data[0] == _START_1
        if self._booting:
            self._waiting += data
            while self._booting and self._answered_next():
                pass
        elif self._device:
            self._device.receive(data, time.monotonic())

    def _answered_next(self) -> bool:
        if self._version_1:
            message = self._message_1()
            if message:
                os.write(self._master, _IN_STEP + self._carry_out_1(message) + _DONE)
                self._end_if(message[0] == _LEAVE_1)
            return bool(message)
        found = self._message()
        if found:
            self._answer(*found)
        return bool(found)

    def _end_if(self, left: bool) -> None:
        if left:
            self._booting = False
            self._device = _running(*self._flashed_firmware) if self.flashed else None

    def _message_1(self) -> bytes:
        waiting = self._waiting
        if not waiting:
            return b""
        size = _SIZES_1.get(waiting[0], 2)
        if waiting[0] == 0x64:  # program page
            size = 5 + int.from_bytes(waiting[1:3], "big") if len(waiting) > 2 else 5
        elif waiting[0] == 0x45:  # extended parameters
            size = 2 + waiting[1] if len(waiting) > 1 else 3
        if len(waiting) < size:
            return b""
        message, self._waiting = bytes(waiting[:size]), waiting[size:]
        assert message[-1] == 0x20
        return message

    def _carry_out_1(self, message: bytes) -> bytes:
        size = int.from_bytes(message[1:3], "big")
        match message[0]:
            case 0x41 | 0x56:  # a parameter of the programmer; one instruction of the chip
                return b"\x02"
            case 0x55:  # load address, in words
                self._address = 2 * int.from_bytes(message[1:3], "little")
            case 0x64:
                self._program(message[4:-1])
            case 0x74:  # read page
                return bytes(self.flash[self._address : self._address + size])
            case 0x75:
                return self._signature
        return b""

    def _program(self, data: bytes) -> None:
        if self._writes:
            self.flash[self._address : self._address + len(data)] = data
            self.flashed = True

    def _message(self) -> tuple[int, bytes] | None:
        size = int.from_bytes(self._waiting[2:4], "big") + 6
        if len(self._waiting) < size or size < 7:
            return None
        message, self._waiting = bytes(self._waiting[:size]), self._waiting[size:]
        assert message[4] == _TOKEN
        assert _checksum(message[:-1]) == message[-1]
        return message[1], message[5:-1]

    def _answer(self, sequence: int, body: bytes) -> None:
        answer = bytes([body[0], 0]) + self._carry_out(body)
        head = bytes([_START, sequence]) + len(answer).to_bytes(2, "big") + bytes([_TOKEN])
        os.write(self._master, head + answer + bytes([_checksum(head + answer)]))
        self._end_if(body[0] == _LEAVE)

    def _carry_out(self, body: bytes) -> bytes:
        size = int.from_bytes(body[1:3], "big")
        match body[0]:
            case 0x01:  # sign on
                return b"\x08AVRISP_2"
            case 0x03:  # a parameter of the programmer
                return b"\x02"
            case 0x06:  # load address, in words
                self._address = 2 * (int.from_bytes(body[1:5], "big") & 0x7FFFFFFF)
            case 0x13:  # program flash
                self._program(body[10 : 10 + size])
                self._address += size
            case 0x14:  # read flash
                self._address += size
                return bytes(self.flash[self._address - size : self._address]) + b"\0"
            case 0x1B:  # read a byte of the signature
                return bytes([self._signature[body[4]], 0])
            case 0x1D:  # one instruction of the chip
                return bytes(5)
        return b""


def _running(firmware: str, profile: str, turning: str) -> FakeBoard:
    identity = BoardIdentity(firmware=firmware, serial="SONAR-000005", profile=profile, turning=turning)
    return FakeBoard(PlainEchoes(), seed=5, identity=identity)


def _checksum(data: bytes) -> int:
    total = 0
    for byte in data:
        total ^= byte
    return total


@contextmanager
def bootloader_board(firmware: str, **options: object) -> Iterator[BootloaderBoard]:
    """A board that serves its port until the block ends."""
    board = BootloaderBoard(firmware, **options)  # type: ignore[arg-type]
    thread = threading.Thread(target=board.run, daemon=True)
    thread.start()
    try:
        yield board
    finally:
        board.end()
        thread.join()
        board.close()
