"""URLs that no scanner can have: one clear error, before anything is opened."""

import pytest

from sonarhw.device.served import TcpServerPort, host_and_port
from sonarhw.errors import InputError, LinkError, SonarError
from sonarhw.link import Link


@pytest.mark.parametrize(
    ("url", "message"),
    [
        (f"socket://{64 * 'a'}:1", "invalid host name; expected 1 to 63 characters between two dots"),
        ("socket://..:1", "invalid host name"),
        ("rfc2217://a..b:1", "invalid host name"),
        ("socket://\udcff:1", "invalid host name"),
        ("socket://127.0.0.1:99999", "with a port from 1 to 65535"),
        ("hwgrep://(", r"invalid regular expression: .*write \\ before a bracket"),
        ("hwgrep://*", "invalid regular expression"),
        ("hwgrep://[&n=1", "invalid regular expression"),
    ],
)
def test_an_invalid_url_is_refused(url: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Link(url)


@pytest.mark.parametrize(
    "url", ["alt://x", "alt:///dev/null?class=None", "spy://missing", "cp2110://x", "hwgrep://x", "/"]
)
def test_what_pyserial_cannot_open_gives_a_link_error_of_one_line(url: str) -> None:
    with pytest.raises(LinkError) as raised:
        Link(url)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("address", ["x:٣", f"x:{5000 * '9'}", "x:99999", "x:-1", "127.0.0.1", ""])
def test_an_invalid_port_to_listen_on_is_refused(address: str) -> None:
    with pytest.raises(InputError, match="expected HOST:PORT"):
        host_and_port(address)


@pytest.mark.parametrize("host", [64 * "a", "..", "a\0b", "\udcff"])
def test_an_invalid_host_to_listen_on_is_refused(host: str) -> None:
    with pytest.raises(SonarError):
        TcpServerPort(f"{host}:0")
