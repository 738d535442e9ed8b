"""A port for servers that cannot choose one themselves."""

import random
import socket
from contextlib import suppress

# Below the numbers that Linux gives to clients and to servers on port 0: no other test gets it before it is used.
_NUMBERS = range(10_000, 32_000)


def free_port() -> int:
    """Return the number of a TCP port on the loopback that is free."""
    choice = random.SystemRandom()  # not the seeded one, which gives parallel tests the same numbers
    while True:
        with suppress(OSError), socket.create_server(("127.0.0.1", choice.choice(_NUMBERS))) as server:
            return int(server.getsockname()[1])
