"""The portable part of the firmware on the test board of firmware/host, called through ctypes in simulated time."""

import ctypes
from pathlib import Path

from sonarhw.wire.frames import Frame, FrameDecoder, encode_frame
from sonarhw.wire.messages import Hello, Home, Message, unpack_message

MICROSTEPS = 7200  # per turn
RAMPED, AT_ONCE, HELD, SLIPPING = range(4)  # enum host_motor
_MOST = 1 << 20


class PortableBoard:
    """The test board. Only one may exist at a time, because the firmware uses global variables."""

    def __init__(self, library: Path) -> None:
        self.c = ctypes.CDLL(str(library))
        self.c.host_advance.argtypes = [ctypes.c_uint64]
        self.c.host_position.restype = ctypes.c_int32
        self.c.host_powered.restype = ctypes.c_bool
        self._buffer = (ctypes.c_uint8 * _MOST)()
        self._kept: tuple[object, ...] = ()
        self._sequence = 0
        self.decoder = FrameDecoder()
        self.now = 0  # µs
        self.c.host_start()
        self.identity("", "", "")

    def identity(self, firmware: str, serial: str, profile: str) -> None:
        """Set the texts of Info."""
        texts = tuple(ctypes.create_string_buffer(text.encode()) for text in (firmware, serial, profile))
        self._kept += texts
        self.c.host_identity(*texts)

    def set_echoes(self, echoes_ns: list[int], trace: bytes = b"", period_ns: int = 13_000) -> None:
        """Set echoes and trace of all following pings."""
        ticks = (ctypes.c_uint32 * max(1, len(echoes_ns)))(*(time // 500 for time in echoes_ns))
        samples = ctypes.create_string_buffer(trace, max(1, len(trace)))
        self._kept += (samples,)
        self.c.host_set_echoes(ticks, len(echoes_ns), samples, len(trace), period_ns)

    def set_lost(self, *indices: int) -> None:
        """Mark these samples of all following traces as lost."""
        self.c.host_set_lost((ctypes.c_uint16 * len(indices))(*indices), len(indices))

    def send(self, data: bytes) -> None:
        """Send bytes to the board."""
        self.c.host_send(data, len(data))

    def advance(self, until: int) -> bytes:
        """Advance the time to `until`, µs, and return the bytes that the board sent."""
        self.c.host_advance(until)
        self.now = until
        size = self.c.host_receive(self._buffer, _MOST)
        return bytes(self._buffer[:size])

    def frames_until(self, until: int) -> list[tuple[Frame, Message]]:
        """Advance the time to `until` and return the frames sent. Fails if one is invalid or of unknown type."""
        received = []
        for item in self.decoder.feed(self.advance(until)):
            assert isinstance(item, Frame), item
            message = unpack_message(item.type, item.payload)
            assert message is not None
            received.append((item, message))
        return received

    def ask(self, message: Message, wait: int = 1000) -> list[Message]:
        """Send a command and return the messages within `wait` µs."""
        self._sequence = (self._sequence + 1) % 0x10000
        self.send(encode_frame(Frame(message.TYPE, self._sequence, 0, message.pack())))
        return [received for _, received in self.frames_until(self.now + wait)]

    def greet_and_home(self, grain: int = 100) -> None:
        """Greet and home the board, with a motor that moves at once."""
        self.c.host_grain(grain)
        self.c.host_motor(AT_ONCE)
        self.ask(Hello(1, 0))
        self.ask(Home(), 100_000)
