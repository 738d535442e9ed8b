"""A device that breaks the document ends the scan with one line that names the rule. No wrong value becomes a range."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from sonarhw.errors import DeviceError
from sonarhw.host.scripts import Job, configuring, scanning
from sonarhw.wire import messages as msg
from sonarhw.wire.frames import FrameDecoder, encode_frame
from tests.fixtures.bench import Bench, rewriting

ORDER = msg.StartScan(start=0, step=10_000_000, headings=36, sweeps=1, pings=1)
SETTINGS = msg.Configure(20_000, 2_380, 0, 343_200)


def started(count: int) -> Callable[[msg.Message], msg.Message]:
    """Return a change of the number of readings in Started."""
    return lambda message: replace(message, readings=count) if isinstance(message, msg.Started) else message


def reading(number: int, **changes: object) -> Callable[[msg.Message], msg.Message]:
    """Return a change of the reading with this number."""

    def changed(message: msg.Message) -> msg.Message:
        here = isinstance(message, msg.ReadingMessage) and message.number == number
        return replace(message, **changes) if here else message  # type: ignore[arg-type]

    return changed


CASES = {
    "endless": (started(2**32 - 1), "Started announces 4294967295 readings from number 0; StartScan requested 36"),
    "empty": (started(0), "Started announces 0 readings"),
    "unordered": (reading(3, echoes=(9_000_000, 7_000_000)), "reading 3: an echo at 9 ms is before one at 7 ms"),
    "blanked": (reading(3, echoes=(2_370_000,)), "an echo at 2.37 ms, before the end of blanking at 2.38 ms"),
    "late": (reading(3, echoes=(20_010_000,)), "an echo at 20.01 ms, after the end of listening at 20 ms"),
    "turned": (reading(3, angle=120_000_000), "reading 3: angle 120 degrees; its number means 30 degrees"),
    "a step too far": (reading(3, angle=30_000_000 + 3 * 360_000_000 // 6400), "reading 3: angle 30.1687 degrees"),
    "swept": (reading(3, sweep=1), "reading 3: sweep 1, ping 0; its number means sweep 0, ping 0"),
    "pinged": (reading(3, ping=2), "reading 3: sweep 0, ping 2; its number means sweep 0, ping 0"),
}


def scan_with(changed: Callable[[msg.Message], msg.Message], path: Path | None = None) -> tuple[Bench, Job]:
    """Scan with a device whose messages are changed; record to `path`."""
    bench = Bench().connect()
    bench.run(configuring(SETTINGS))
    bench.up = rewriting(changed)
    return bench, bench.run(scanning(ORDER))


@pytest.mark.parametrize(("changed", "rule"), CASES.values(), ids=CASES.keys())
def test_a_broken_rule_ends_the_scan_and_is_named(changed: Callable[[msg.Message], msg.Message], rule: str) -> None:
    bench, scan = scan_with(changed)
    assert isinstance(scan.error, DeviceError)
    assert rule in str(scan.error)
    assert "firmware breaks the protocol" in str(scan.error)
    assert "cable" not in str(scan.error)
    # the readings that agree with the document are delivered, and the device does not go on
    assert [one.number for one in scan.readings] == ([0] if "Started" in rule else [0, 1, 2])
    assert not bench.board.busy
    bench.up = lambda data: data
    assert len(bench.run(scanning(ORDER)).readings) == 36


@pytest.mark.parametrize("echo", [2_380_000, 20_000_000])
def test_echoes_at_both_ends_of_the_window_are_valid(echo: int) -> None:
    _, scan = scan_with(reading(3, echoes=(echo,)))
    assert scan.error is None
    assert len(scan.readings) == 36


def test_a_device_clock_that_stands_still_is_not_called_a_bad_cable() -> None:
    def standing(data: bytes) -> bytes:
        still = rewriting(lambda m: replace(m, fired_us=0) if isinstance(m, msg.ReadingMessage) else m)(data)
        return b"".join(encode_frame(replace(frame, time_us=0)) for frame in FrameDecoder().feed(still))

    bench = Bench()
    bench.up = standing
    bench.connect()
    scan = bench.run(scanning(ORDER))
    assert "readings 0 and 1 have the same fired_us; the device clock must not stop" in str(scan.error)
    assert "cable" not in str(scan.error)


@pytest.mark.parametrize(
    ("settings", "rule"),
    [({"speed_of_sound": 0}, "speed_of_sound of 0"), ({"listen_us": 0}, "listen_us 0; expected 1")],
)
def test_settings_that_measure_nothing_are_refused(settings: dict[str, int], rule: str) -> None:
    bench = Bench().connect()
    bench.up = rewriting(lambda message: replace(message, **settings) if isinstance(message, msg.Settings) else message)
    assert rule in str(bench.run(configuring(SETTINGS)).error)


def test_another_count_of_starts_is_a_reset_also_of_a_clock_that_goes_on() -> None:
    starts = iter([0, 0, 1])
    bench, scan = scan_with(lambda m: replace(m, boot=m.boot + next(starts, 0)) if isinstance(m, msg.Heartbeat) else m)
    assert (scan.error, len(scan.readings)) == (None, 36)
    assert bench.session.statistics.losses == 1


def test_counts_in_heartbeats_and_finished_beyond_the_scan_are_harmless() -> None:
    def far(message: msg.Message) -> msg.Message:
        return replace(message, readings=2**32 - 1) if isinstance(message, msg.Heartbeat | msg.Finished) else message

    _, scan = scan_with(far)
    assert len(scan.readings) == 36
