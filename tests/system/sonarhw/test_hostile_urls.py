"""URLs that no scanner can have: one clear error, before anything is opened."""

import os

import pytest
from serial.tools.list_ports_common import ListPortInfo

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


@pytest.mark.parametrize(
    ("url", "error", "message"),
    [
        ("hwgrep://(a+)+x", InputError, "takes more than a second; write it without a repetition"),
        ("hwgrep://sonar-[a-c]", LinkError, "no port matches this pattern"),
    ],
)
def test_a_pattern_of_port_names_is_matched_within_a_limit(
    url: str, error: type[SonarError], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sonarhw.link.comports", lambda: [ListPortInfo("/dev/" + 40 * "a")])
    with pytest.raises(error, match=message):
        Link(url)


@pytest.mark.parametrize("options", ["", "&skip_busy"])
def test_a_pattern_opens_the_port_whose_name_it_matches(options: str, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("termios")
    master, slave = os.openpty()
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda _: [ListPortInfo(os.ttyname(slave))])
    monkeypatch.setattr("sonarhw.link.comports", lambda: [ListPortInfo(os.ttyname(slave))])
    with Link(f"hwgrep://PTS/[0-9]+{options}") as link:
        os.write(master, b"reading")
        assert link.read() == b"reading"
    os.close(master)
    os.close(slave)


@pytest.mark.parametrize("address", ["x:٣", f"x:{5000 * '9'}", "x:99999", "x:-1", "127.0.0.1", ""])
def test_an_invalid_port_to_listen_on_is_refused(address: str) -> None:
    with pytest.raises(InputError, match="expected HOST:PORT"):
        host_and_port(address)


@pytest.mark.parametrize("host", [64 * "a", "..", "a\0b", "\udcff"])
def test_an_invalid_host_to_listen_on_is_refused(host: str) -> None:
    with pytest.raises(SonarError):
        TcpServerPort(f"{host}:0")
