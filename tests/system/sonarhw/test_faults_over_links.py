"""Faults of a fake scanner over real links: the example of the document, unplugs and another protocol version."""

import threading
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest

from sonarhw.device.served import Endpoint, open_server_port, serve
from sonarhw.errors import Incompatible, LinkError, LinkLost
from sonarhw.host.scanner import Scanner
from sonarhw.link import Link
from sonarhw.wire.frames import Frame, encode_frame
from sonarhw.wire.messages import Hello
from tests.fixtures.faulty_boards import faulty
from tests.hang_guard import wait_until


@pytest.mark.parametrize("line", ["pty", "tcp"])
@pytest.mark.parametrize("fault", ["unplug", "move"])
def test_the_scan_continues_when_the_port_returns_under_any_name(line: str, fault: str, tmp_path: Path) -> None:
    with open_server_port(**{"pty": tmp_path / "scanner"} if line == "pty" else {"tcp": "127.0.0.1:0"}) as port:  # type: ignore[arg-type]
        endpoint = Endpoint(faulty(f"{fault}=5@20"), port, pace=20.0)
        before, serving = endpoint.url, threading.Thread(target=endpoint.run, name="serve")
        with ExitStack() as stack:
            with Link(before) as link:
                serving.start()  # not earlier, otherwise the unplug may come before the link is open
                stack.callback(serving.join)
                stack.callback(endpoint.stop)
                with pytest.raises(LinkLost):
                    read_until_error(link)
            with reopened(endpoint) as link:
                assert (link.url == before) == (fault == "unplug")
                link.write(encode_frame(Frame(Hello.TYPE, 0, 0, Hello(1, 0).pack())))
                wait_until(link.read)
            assert (tmp_path / "scanner").is_symlink() == (line == "pty" and fault == "unplug")
            assert (tmp_path / "scanner-1").is_symlink() == (line == "pty" and fault == "move")


def read_until_error(link: Link) -> None:
    """Read until `read` raises an error."""
    while True:
        link.read()


def reopened(endpoint: Endpoint) -> Link:
    """Return a link to the current URL of the device, as soon as it can be opened."""
    links: list[Link] = []

    def opened() -> bool:
        with suppress(LinkError):
            links.append(Link(endpoint.url))
        return bool(links)

    wait_until(opened)
    return links[0]


def test_another_protocol_version_is_refused_with_its_number() -> None:
    with serve(faulty("protocol=0.9"), tcp="127.0.0.1:0") as endpoint, pytest.raises(Incompatible, match=r"0\.9"):
        Scanner.open(endpoint.url)
