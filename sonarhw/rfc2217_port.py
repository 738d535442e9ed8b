"""pyserial's RFC 2217 port, made to bear a server that goes away: no socket left open, no thread that dies aloud."""

import threading
from typing import Any

from serial.rfc2217 import Serial


class Rfc2217Port(Serial):
    """A serial port behind a server such as ser2net."""

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
