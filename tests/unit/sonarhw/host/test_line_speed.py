"""The speed of the line and the greeting of a session, over lines that damage bytes above a speed."""

import itertools
import random
from collections import Counter

import pytest

from sonarhw.device.fake_board import BoardIdentity
from sonarhw.errors import NoAnswer
from sonarhw.host.scripts import scanning
from sonarhw.host.session import Connection, Session
from sonarhw.link import BOOTLOADER
from sonarhw.wire.frames import Frame, encode_frame
from sonarhw.wire.messages import Heartbeat
from tests.fixtures.pulled_cables import Bench
from tests.unit.sonarhw.host.test_session import ORDER, assert_complete

FAST = BoardIdentity(serial="FAST", bauds=(250_000, 500_000, 1_000_000))


@pytest.mark.parametrize("clean_down", [False, True], ids=["damaged in both directions", "damaged to the host"])
@pytest.mark.parametrize("clean_up_to", [250_000, 500_000, 1_000_000])
def test_the_line_uses_the_highest_speed_without_errors(clean_up_to: int, clean_down: bool) -> None:
    bench = Bench(FAST, bauds=True)
    bench.highest_clean_baud, bench.clean_down = clean_up_to, clean_down
    bench.connect()
    assert bench.session.device.baud == bench.board.line.baud == clean_up_to
    assert bench.now < 10
    assert_complete([*bench.run(scanning(ORDER)).readings])


def test_a_speed_that_failed_is_not_used_in_a_later_conversation() -> None:
    bench = Bench(FAST, bauds=True)
    bench.highest_clean_baud, bench.clean_down = 500_000, True
    bench.connect()
    bench.board.line.change(1_000_000)
    bench.highest_clean_baud = 1_000_000
    bench.until(lambda: bench.session.state is not Connection.READY)
    bench.connect()
    assert bench.session.device.baud == bench.board.line.baud == 500_000


def test_a_device_that_was_reset_is_found_again_at_its_first_speed() -> None:
    bench = Bench(FAST, bauds=True).connect()
    assert bench.board.line.baud == 1_000_000
    scan = bench.scan(ORDER)
    bench.until(lambda: len(scan.readings) == 5)
    bench.reset()
    bench.until(lambda: scan.done)
    assert_complete([*scan.readings])
    assert bench.board.line.baud == 1_000_000


def test_a_device_left_at_a_higher_speed_is_found() -> None:
    bench = Bench(FAST, bauds=True)
    bench.board.line.change(1_000_000)
    bench.connect()
    assert bench.session.state is Connection.READY


def test_errors_at_a_wrong_speed_before_the_greeting_are_not_counted() -> None:
    bench = Bench(FAST, bauds=True)
    bench.board.line.change(1_000_000)
    bench.connect()
    counted = bench.session.statistics
    assert (counted.rejected_blocks, counted.missing_frames, counted.repeated_commands) == (0, 0, 0)


def test_the_speed_at_which_a_frame_arrives_is_tried_again() -> None:
    session = Session("the port", rng=random.Random(1))
    session.connect(0.0)
    session.opened(0.0, bauds=True)
    session.advance(0.0)
    beat = Heartbeat(0, 0, 0, 2000)
    session.receive(encode_frame(Frame(beat.TYPE, 5, 0, beat.pack())), 0.7)  # the device returned to its first speed
    bauds = []
    for tenth in range(7, 25):
        session.advance(tenth / 10)
        if session.outgoing():
            bauds.append(session.device.baud)
    assert bauds[:4] == [250_000, 250_000, 250_000, 1_000_000]


def test_a_line_without_a_settable_speed_is_left_unchanged() -> None:
    bench = Bench(FAST).connect()
    assert bench.board.line.baud == 250_000


# a bootloader


def test_a_possible_bootloader_receives_nothing_for_two_seconds() -> None:
    session = Session("the port", rng=random.Random(1))
    session.connect(0.0)
    session.opened(0.0, quiet=BOOTLOADER)
    sent_at = []
    for tenth in range(40):
        session.advance(tenth / 10)
        if session.outgoing():
            sent_at.append(tenth / 10)
    assert sent_at[0] == pytest.approx(2.0)
    assert sent_at[1] == pytest.approx(2.5)


def test_a_first_greeting_tries_each_speed_of_the_line_three_times_before_it_gives_up() -> None:
    session = Session("the port", rng=random.Random(1))
    session.connect(0.0)
    session.opened(0.0, bauds=True)
    bauds, now = [], 0.0
    while session.failed is None:
        if session.outgoing():
            bauds.append(session.device.baud)
        now = session.next_event()
        session.advance(now)
    assert min(Counter(baud for baud, _ in itertools.groupby(bauds)).values()) >= 3
    assert isinstance(session.failed, NoAnswer)


def test_a_device_that_already_sends_is_greeted_at_once() -> None:
    session = Session("the port", rng=random.Random(1))
    session.connect(0.0)
    session.opened(0.0, quiet=BOOTLOADER)
    beat = Heartbeat(0, 0, 0, 2000)
    session.receive(encode_frame(Frame(beat.TYPE, 5, 0, beat.pack())), 0.3)
    assert session.outgoing()
