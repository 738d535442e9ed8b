"""`sonarhw.open_scanner` opens fake scanners, logs, ports and added schemes, and closes what it has started."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
from sonarhw_compare.scanner_url import SCHEMES
from sonarhw_sim.predict.room_echoes import RoomEchoes
from sonarhw_sim.rays import fan

import sonarhw
from sonarhw.device.fake_board import FakeBoard
from sonarhw.device.served import serve
from sonarhw.errors import DeviceError, InputError, LinkError, LinkLost
from sonarhw.readings import sector
from tests.fixtures.plain_echoes import PlainEchoes

FAKE = "fake:laboratory?place=bench&seed=1&pace=max"


SHORT = sector(0, 90, 10)


pytestmark = pytest.mark.usefixtures("nothing_remains")


@contextmanager
def plain_board() -> Iterator[str]:
    with serve(FakeBoard(PlainEchoes()), tcp="127.0.0.1:0", pace="max") as endpoint:
        yield endpoint.url


def test_only_a_scan_prepares_the_room(monkeypatch: pytest.MonkeyPatch) -> None:
    prepared: list[object] = []
    prepare = RoomEchoes.prepare

    def counted(echoes: RoomEchoes) -> None:
        prepared.append(echoes)
        prepare(echoes)

    monkeypatch.setattr(RoomEchoes, "prepare", counted)
    with sonarhw.open_scanner(FAKE) as scanner:
        scanner.home()
        scanner.turn(1.0)
        assert prepared == []
        list(scanner.scan(SHORT))
    assert len(prepared) == 1


def test_a_scan_reports_a_room_with_too_many_paths(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fan, "MOST_POINTS", 80)
    with sonarhw.open_scanner(FAKE) as scanner:
        scanner.home()
        with pytest.raises(DeviceError, match="too many paths: "):
            list(scanner.scan(SHORT))


def test_close_ends_the_fake_without_a_block() -> None:
    scanner = sonarhw.open_scanner(FAKE)
    assert len(list(scanner.scan(SHORT))) == 9
    scanner.close()
    scanner.close()
    with pytest.raises(LinkLost, match="was closed"):
        scanner.home()


@pytest.mark.parametrize(
    ("url", "error"),
    [
        ("fake:laboratory?place=nowhere", InputError),
        ("fake:laboratory", InputError),
        ("fake:", InputError),
        ("no-such-file.mcap", InputError),
        ("/dev/no-such-port", LinkError),
    ],
)
def test_a_url_that_cannot_be_opened_raises_and_leaves_nothing(url: str, error: type[Exception]) -> None:
    with pytest.raises(error):
        sonarhw.open_scanner(url)


def test_a_scheme_can_be_added(monkeypatch: pytest.MonkeyPatch) -> None:
    closed = []

    @contextmanager
    def serve_mine(url: str, warn: Callable[[str], None]) -> Iterator[Callable[[], str]]:
        with plain_board() as there:
            yield lambda: there
        closed.append(url)

    monkeypatch.setitem(SCHEMES, "mine", serve_mine)
    with sonarhw.open_scanner("mine:anything") as scanner:
        assert len(list(scanner.scan(SHORT))) == 9
        assert closed == []
    assert closed == ["mine:anything"]
