"""Schedules of faults are parsed as docs/devices/faults.md states, and the fake scanner produces these faults."""

import math
import re

import pytest

from sonarhw.device.faults import KNOWN, Event, FaultKind, Faults, LineNoise, read_faults
from sonarhw.errors import InputError, SonarError
from sonarhw.host.driver import Driver
from sonarhw.wire.frames import Frame, FrameDecoder
from sonarhw.wire.messages import AskStatistics, Hello, Home, Outcome, Refusal, Refused, StartScan, Statistics, Turn
from tests.checkout import CHECKOUT
from tests.fixtures.faulty_boards import faulty
from tests.fixtures.joined import Joined
from tests.fixtures.plain_echoes import echo_time

DOCUMENT = (CHECKOUT / "docs" / "devices" / "faults.md").read_text(encoding="utf-8")
MICROSTEP = math.tau / 3200


def joined_with(spec: str) -> Joined:
    """Return a driver and a board with these faults."""
    return Joined(board=faulty(spec))


# the text


def test_the_table_of_the_document_lists_every_fault_with_its_default_size() -> None:
    rows = re.findall(r"^\| `(\w+)=\w+[\w.]*` \|.*\| (.*?) ?\|$", DOCUMENT, flags=re.MULTILINE)
    assert [name for name, _ in rows] == list(KNOWN)
    for kind in FaultKind:
        default = dict(rows)[kind.text]
        assert kind.size == (math.inf if default == "for ever" else float(default))


def test_every_example_of_the_document_is_a_schedule() -> None:
    specs = re.findall(r'--faults (\S+)$|read_faults\("(.*?)"\)|`(\w+=\S+@\S+)`', DOCUMENT, flags=re.MULTILINE)
    assert len(specs) == 3
    assert all(read_faults("".join(groups)) != Faults() for groups in specs)


def test_a_schedule_is_parsed_from_its_text() -> None:
    assert read_faults("") == Faults()
    assert read_faults("drop=1/5000, flip=1e-4,drift=-20,protocol=0.9,reset@r20,stall=0.4@12.5,unplug=2@~30,wedge") == (
        Faults(
            drop=1 / 5000,
            flip=1e-4,
            drift=-20,
            protocol=(0, 9),
            events=(
                Event(FaultKind.RESET, 0.5, pings=20),
                Event(FaultKind.STALL, 0.4, 12.5),
                Event(FaultKind.UNPLUG, 2.0, 30, repeats=True),
                Event(FaultKind.WEDGE, math.inf, 0),
            ),
        )
    )


@pytest.mark.parametrize(
    "spec",
    [
        *("rust=1", "Drop=0.1", "drop", "drop=x", "drop=2", "drop=-1", "drop=1/0", "drop=nan"),
        *("flip=0.1@5", "drop=0,drop=0", "drift=1e9"),
        *("protocol=1", "protocol=1.x", "protocol=1.300", "stall=-1", "reset=inf"),
        *("reset@", "reset@never", "reset@-1", "reset@r", "reset@r1.5", "reset@~0", "reset@~-3"),
    ],
)  # fmt: skip
def test_an_invalid_schedule_is_refused_with_an_error_of_one_line(spec: str) -> None:
    with pytest.raises(InputError, match="fault ") as refused:
        read_faults(spec)
    assert "\n" not in str(refused.value)


def test_an_unknown_fault_is_named_once() -> None:
    with pytest.raises(InputError, match=r"^unknown fault 'foo'; expected one of drop, flip, insert, drift, "):
        read_faults("drop=0,foo=1@3")


def test_the_limits_themselves_are_valid() -> None:
    assert read_faults("drop=0,flip=1,drift=-100000") == Faults(drop=0.0, flip=1.0, drift=-100_000.0)
    assert read_faults("stall=0@0").events == (Event(FaultKind.STALL, 0.0, 0.0),)
    assert read_faults("protocol=255.255").protocol == (255, 255)


# the line


@pytest.mark.parametrize("name", ["drop", "flip", "insert"])
def test_the_requested_share_of_bytes_is_damaged(name: str) -> None:
    sent = bytes(range(1, 251)) * 4000  # a million
    arrived = LineNoise(Faults(**{name: 1 / 1000}), seed=4).damage(sent)
    expected, spread = 1000, math.sqrt(1000)
    if name == "drop":
        assert len(sent) - len(arrived) == pytest.approx(expected, abs=5 * spread)
    elif name == "insert":
        assert len(arrived) - len(sent) == pytest.approx(expected, abs=5 * spread)
    else:
        flipped = [a ^ b for a, b in zip(sent, arrived, strict=True) if a != b]
        assert len(flipped) == pytest.approx(expected, abs=5 * spread)
        assert all(change.bit_count() == 1 for change in flipped)


def test_damage_depends_on_the_seed_and_not_on_the_pieces_of_the_stream() -> None:
    faults, sent = Faults(drop=0.01, flip=0.02, insert=0.01), bytes(range(250)) * 20
    whole, in_pieces = LineNoise(faults, seed=9), LineNoise(faults, seed=9)
    assert whole.damage(sent) == b"".join(in_pieces.damage(sent[at : at + 7]) for at in range(0, len(sent), 7))
    assert LineNoise(faults, seed=10).damage(sent) != LineNoise(faults, seed=9).damage(sent)
    assert LineNoise(Faults(drop=1.0), seed=0).damage(sent) == b""


def test_a_stalled_line_loses_nothing_and_releases_everything_at_once() -> None:
    joined = joined_with("stall=0.4@r3")
    joined.greet()
    arrivals = {}
    joined.ask(StartScan(0, 1_000_000, 12, 1, 1))
    while len(joined.readings) < 12:
        joined.step()
        arrivals.update({reading.number: joined.now for reading in joined.readings if reading.number not in arrivals})
    assert arrivals[4] == arrivals[5] == arrivals[6] == pytest.approx(arrivals[2] + 0.4, abs=0.01)
    assert joined.driver.statistics.missing_frames == 0


def test_a_drifting_clock_gives_other_times_than_the_host() -> None:
    periods = []
    for spec in ("drift=0", "drift=500"):
        joined = joined_with(spec)
        joined.greet()
        times = [reading.time for reading in joined.scan(StartScan(0, 1_000_000, 50, 1, 1))]
        periods.append(times[-1] - times[0])
        began = joined.now
        joined.scan(StartScan(0, 1_000_000, 50, 1, 1))
        periods.append(joined.now - began)
    # the ping period is unchanged on the clock of the board, but not on the clock of the host
    assert periods[2] == pytest.approx(periods[0], abs=2e-6)
    assert periods[3] == pytest.approx(periods[1] / 1.0005, rel=1e-6)


# the board


def test_homing_a_jammed_turntable_is_an_error() -> None:
    joined = joined_with("wedge=3")
    joined.ask(Hello(1, 0))
    finished = joined.act(Home()).finished
    assert finished is not None
    assert finished.outcome == Outcome.FAULT
    assert "zero mark was not found" in finished.text
    joined.until(lambda: joined.now > 4)
    again = joined.act(Home()).finished
    assert again is not None
    assert again.outcome == Outcome.DONE


def test_missed_steps_change_the_echoes_until_the_board_is_homed() -> None:
    joined = joined_with("slip=100@r5")
    joined.greet()
    readings = joined.scan(StartScan(0, 2_000_000, 10, 1, 1))
    for reading in readings[:5]:
        assert reading.echo_times[0] == pytest.approx(echo_time(reading.angle), abs=1e-9)
    for reading in readings[6:]:
        assert reading.echo_times[0] == pytest.approx(echo_time(reading.angle - 100 * MICROSTEP), abs=1e-9)
    joined.act(Home())
    for reading in joined.scan(StartScan(0, 2_000_000, 10, 1, 1)):
        assert reading.echo_times[0] == pytest.approx(echo_time(reading.angle), abs=1e-9)


@pytest.mark.parametrize("fault", ["slip=100@r5", "slip=-3@r5", "wedge=0.2@r5", "wedge@r5"])
def test_missed_steps_are_detected_at_the_zero_mark_and_end_the_scan(fault: str) -> None:
    joined = joined_with(fault)
    joined.greet()
    scan = joined.ask(StartScan(-10_000_000, 2_000_000, 12, 4, 1))
    joined.until(lambda: scan.finished is not None)
    assert scan.finished is not None
    # each sweep passes the mark once; readings are verified up to the previous pass
    assert scan.finished.outcome == Outcome.LOST_STEPS
    assert scan.finished.readings <= 5 + 12
    assert "microsteps from its place" in scan.finished.text
    refused = joined.ask(Turn(0)).answer
    assert isinstance(refused, Refused)
    assert refused.code == Refusal.NOT_HOMED
    statistics = joined.ask(AskStatistics()).answer
    assert isinstance(statistics, Statistics)
    assert statistics.lost_steps > 0


def test_a_released_turntable_has_missed_the_steps_of_the_jam() -> None:
    joined = joined_with("wedge=0.5@r1")
    joined.greet()
    joined.act(Turn(90_000_000))
    joined.scan(StartScan(90_000_000, 1, 1, 1, 1))
    joined.act(Turn(120_000_000))  # takes 0.17 s, all of it while jammed
    joined.until(lambda end=joined.now + 1: joined.now > end)  # type: ignore[misc]
    (reading,) = joined.scan(StartScan(120_000_000, 1, 1, 1, 1))
    assert reading.echo_times[0] == pytest.approx(echo_time(math.radians(90)), abs=1e-8)


def test_a_reset_clears_the_state_of_the_board() -> None:
    board = faulty("reset=0.5@r3")
    joined = Joined(board=board)
    joined.greet()
    joined.ask(StartScan(0, 1_000_000, 20, 1, 1))
    joined.until(lambda: len(joined.readings) == 3)
    began = joined.now
    assert not board.busy
    assert board.advance(began + 0.4) == b""
    hello = Driver(first_sequence=9)
    hello.command(Hello(1, 0), began + 0.6)
    board.receive(hello.outgoing(), began + 0.6)
    (info,) = FrameDecoder().feed(board.advance(began + 0.61))
    assert isinstance(info, Frame)
    assert (info.sequence, info.time_us < 200_000) == (0, True)


def test_random_bytes_are_never_taken_for_a_reading_or_a_scanner() -> None:
    for seed in range(20):
        joined = Joined(board=faulty("nonsense", seed))
        with pytest.raises(SonarError):
            joined.greet()
        assert joined.readings == []
        assert joined.driver.info is None


def test_bytes_that_wait_in_a_stalled_line_arrive_once_also_after_several_stalls() -> None:
    """The board has received as many frames as the host has sent."""
    joined = joined_with("stall=0.4@1,stall=0.4@2,stall=0.4@3")
    joined.ask(Hello(1, 1))
    for moment in (1.1, 2.1, 3.1, 4.0):
        while joined.now < moment:
            joined.step()
        statistics = joined.ask(AskStatistics()).answer
    assert isinstance(statistics, Statistics)
    assert statistics.frames == joined.driver.statistics.frames_sent
