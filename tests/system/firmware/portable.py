"""The portable part of the firmware on a board of plain variables, called through ctypes; time is a number."""

import ctypes
from pathlib import Path

from sonarhw.wire.frames import Frame, FrameDecoder, encode_frame
from sonarhw.wire.messages import Hello, Home, Message, unpack_message

MICROSTEPS = 7200  # of a whole turn
RAMPED, AT_ONCE, HELD, SLIPPING = range(4)  # how the motor turns
_MOST = 1 << 20


class PortableBoard:
    """One at a time: the firmware's variables are there once."""

    def __init__(self, library: Path) -> None:
        self.c = ctypes.CDLL(str(library))
        self.c.host_advance.argtypes = [ctypes.c_uint64]
        self.c.host_stands.restype = ctypes.c_int32
        self.c.host_powered.restype = ctypes.c_bool
        self._buffer = (ctypes.c_uint8 * _MOST)()
        self._kept: tuple[object, ...] = ()
        self._sequence = 0
        self.decoder = FrameDecoder()
        self.now = 0  # µs
        self.c.host_start()
        self.identity("", "", "")

    def identity(self, firmware: str, serial: str, profile: str) -> None:
        """What it says of itself."""
        texts = tuple(ctypes.create_string_buffer(text.encode()) for text in (firmware, serial, profile))
        self._kept += texts
        self.c.host_identity(*texts)

    def hear(self, echoes_ns: list[int], trace: bytes = b"", period_ns: int = 13_000) -> None:
        """What every ping hears from now on."""
        ticks = (ctypes.c_uint32 * max(1, len(echoes_ns)))(*(time // 500 for time in echoes_ns))
        samples = ctypes.create_string_buffer(trace, max(1, len(trace)))
        self._kept += (samples,)
        self.c.host_hear(ticks, len(echoes_ns), samples, len(trace), period_ns)

    def send(self, data: bytes) -> None:
        """Put bytes on its line."""
        self.c.host_send(data, len(data))

    def advance(self, until: int) -> bytes:
        """Let time pass up to `until`, µs; the bytes it sent."""
        self.c.host_advance(until)
        self.now = until
        size = self.c.host_receive(self._buffer, _MOST)
        return bytes(self._buffer[:size])

    def says(self, until: int) -> list[tuple[Frame, Message]]:
        """The frames it sends until then. Fails where one is not sound, or of no known type."""
        said = []
        for item in self.decoder.feed(self.advance(until)):
            assert isinstance(item, Frame), item
            message = unpack_message(item.type, item.payload)
            assert message is not None
            said.append((item, message))
        return said

    def ask(self, message: Message, wait: int = 1000) -> list[Message]:
        """Send a command; what is said within `wait` µs."""
        self._sequence = (self._sequence + 1) % 0x10000
        self.send(encode_frame(Frame(message.TYPE, self._sequence, 0, message.pack())))
        return [said for _, said in self.says(self.now + wait)]

    def greet_and_home(self, grain: int = 100) -> None:
        """Make it ready to scan, with a motor that is there at once."""
        self.c.host_grain(grain)
        self.c.host_motor(AT_ONCE)
        self.ask(Hello(1, 0))
        self.ask(Home(), 100_000)
