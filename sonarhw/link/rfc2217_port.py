"""pyserial's RFC 2217 port with faster reads, and without errors after the server has closed the connection.

pyserial itself would then leave a socket open and print a traceback from its reader thread.
"""

import threading
from typing import Any

from serial.rfc2217 import Serial


class Rfc2217Port(Serial):
    """A serial port behind a server such as ser2net."""

    def read(self, size: int = 1) -> bytes:
        """Return the received bytes, at most `size`. Raises SerialException if the server has closed the connection."""
        # with a timeout of 0, pyserial returns one byte per call, which is too slow for traces
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
            # no caller catches errors of pyserial's reader thread; its next read fails in any case
            if threading.current_thread() is not getattr(self, "_thread", None):
                raise
