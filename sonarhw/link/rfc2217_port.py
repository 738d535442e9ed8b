"""pyserial's RFC 2217 port with faster reads and a clean end after the server has gone.

Without it a socket stays open, and the reader thread ends with a traceback.
"""

import threading
from typing import Any

from serial.rfc2217 import Serial


class Rfc2217Port(Serial):
    """A serial port behind a server such as ser2net."""

    def read(self, size: int = 1) -> bytes:
        """Return the received bytes, at most `size`. Raises SerialException if the server has gone."""
        # pyserial returns a single byte per call if it may not wait, which is too slow for traces
        data = bytearray()
        while len(data) < size and (piece := super().read(1)):
            data += piece
        return bytes(data)

    def close(self) -> None:
        """Close the port."""
        # pyserial leaves the socket open if the peer has closed first
        socket: Any = getattr(self, "_socket", None)
        super().close()
        if socket is not None:
            socket.close()

    def _internal_raw_write(self, data: bytes) -> None:
        try:
            super()._internal_raw_write(data)  # type: ignore[misc]  # missing in the type stubs
        except OSError:
            # in pyserial's reader thread no caller would catch this; its next read fails as well
            if threading.current_thread() is not getattr(self, "_thread", None):
                raise
