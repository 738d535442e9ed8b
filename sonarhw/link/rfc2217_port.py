"""pyserial's RFC 2217 port, made to read many bytes at once and to bear a server that goes away.

Then no socket is left open, and no thread dies aloud.
"""

import threading
from typing import Any

from serial.rfc2217 import Serial


class Rfc2217Port(Serial):
    """A serial port behind a server such as ser2net."""

    def read(self, size: int = 1) -> bytes:
        """The bytes that have come, at most `size`. Raises SerialException where the server has gone."""
        # pyserial hands out one at a time where it is not to wait: too slow for a scanner that has much to say
        data = bytearray()
        while len(data) < size and (piece := super().read(1)):
            data += piece
        return bytes(data)

    def close(self) -> None:
        """Close the port."""
        # pyserial leaves the socket open where the peer has gone first
        socket: Any = getattr(self, "_socket", None)
        super().close()
        if socket is not None:
            socket.close()

    def _internal_raw_write(self, data: bytes) -> None:
        try:
            super()._internal_raw_write(data)  # type: ignore[misc]  # not in its types
        except OSError:
            # the reader's thread, which answers the server, has nobody to tell; it finds out at its next read
            if threading.current_thread() is not getattr(self, "_thread", None):
                raise
