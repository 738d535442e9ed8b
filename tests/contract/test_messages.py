"""The promises of firmware_protocol.md, message by message, for any device.

The kind of line makes no difference to them, so each device is tested over one line; with `--soak`, over every line.
"""

import itertools
from dataclasses import astuple, fields, replace

import pytest

from sonarhw.readings import ScanOrder
from sonarhw.wire import messages as msg
from sonarhw.wire.limits import BAUD_TIMEOUT, HOST_SILENCE, MAX_ECHOES, PROTOCOL_MAJOR
from tests.contract.conftest import OpenLine
from tests.contract.talk import Talk, readings
from tests.fixtures.protocol_document import command_of, kind_of, rows

pytestmark = pytest.mark.one_line
DEGREE = 1_000_000  # µdeg
NOISE = 35_000  # ns, 4 standard deviations of the difference of two echo times. At 10° it is 76 µs earlier than at 0°
TEN = msg.StartScan(start=10 * DEGREE, step=5 * DEGREE, headings=5, sweeps=2, pings=1)
LONG = msg.StartScan(start=0, step=DEGREE, headings=90, sweeps=4, pings=1)


def short(message: msg.Message) -> str:
    """Return a short text of a message for the name of a test."""
    return f"{type(message).__name__}{astuple(message)}"


def microstep(info: msg.Info) -> float:
    """Return the angle of one microstep, µdeg."""
    return 360 * DEGREE / info.microsteps


# identity


def test_hello_is_answered_with_the_identity(talk: Talk) -> None:
    info = talk.greet()
    assert info.major == PROTOCOL_MAJOR
    assert info.firmware
    assert info.microsteps > 0
    assert info.temperature == msg.NO_TEMPERATURE or -4000 < info.temperature < 8500


def test_the_identity_and_the_boot_counter_stay_the_same(talk: Talk) -> None:
    first, second = talk.greet(), talk.greet()
    assert (first.serial, first.firmware, first.boot) == (second.serial, second.firmware, second.boot)


def test_capabilities_agree_with_the_identity(talk: Talk) -> None:
    info, capabilities = talk.greet(), talk.capabilities()
    assert capabilities.lowest_angle <= 0 < capabilities.highest_angle
    assert 1 <= capabilities.most_echoes <= MAX_ECHOES
    assert capabilities.readings_kept >= 1
    assert bool(capabilities.features & msg.Feature.THERMOMETER) == (info.temperature != msg.NO_TEMPERATURE)
    assert bool(capabilities.features & (msg.Feature.ENVELOPE | msg.Feature.CARRIER)) == bool(
        capabilities.fastest_trace
    )


def test_statistics_count_the_frames_sent(talk: Talk) -> None:
    before = talk.ask(msg.AskStatistics(), msg.Statistics)
    for _ in range(3):
        talk.ask(msg.AskStatistics(), msg.Statistics)
    talk.write(b"\0no frame\0")
    after = talk.ask(msg.AskStatistics(), msg.Statistics)
    assert after.frames - before.frames == 4
    assert after.rejected - before.rejected == 1


# settings


def test_requested_settings_are_applied_within_the_limits(talk: Talk) -> None:
    for listen in (5_000, 20_000):
        settings = talk.ask(msg.Configure(listen, 2_380, 0, 345_678), msg.Settings)
        assert (settings.listen_us, settings.blanking_us) == (listen, 2_380)
        assert (settings.trace, settings.speed_of_sound) == (0, 345_678)


def test_the_listening_time_is_limited_to_the_capability(talk: Talk) -> None:
    settings = talk.ask(msg.Configure(10_000_000, 2_380, 0, 343_200), msg.Settings)
    assert settings.listen_us == talk.capabilities().longest_listen_us


# refusals


def test_documented_refusals_have_the_documented_code(talk: Talk) -> None:
    talk.home()
    for text, code in rows("What is refused"):
        refused = talk.ask(command_of(text), msg.Refused)
        assert (msg.Refusal(refused.code).name, bool(refused.text)) == (code, True), text


@pytest.mark.parametrize(
    ("order", "bound"),
    [
        (msg.StartScan(0, DEGREE, 10, 1, 1, 10, 6), "first is 10; expected 0 to 9"),
        (msg.StartScan(0, DEGREE, 10, 1, 1, 5, 6), "count is 6; expected 0 to 5"),
    ],
)
def test_the_refusal_of_a_part_of_a_scan_states_the_right_bound(talk: Talk, order: msg.StartScan, bound: str) -> None:
    talk.home()
    assert bound in talk.ask(order, msg.Refused).text


@pytest.mark.direct
def test_before_hello_all_commands_are_refused_and_nothing_else_is_sent(talk: Talk) -> None:
    talk.home()
    talk.quiet(HOST_SILENCE + 0.1)
    for name, *_ in rows("Commands at a glance")[1:]:
        assert talk.ask(simplest(name), msg.Refused).code == msg.Refusal.NO_HELLO, name
    assert talk.quiet(2.0) == []


def simplest(name: str) -> msg.Message:
    """Return a command that an idle device carries out and a busy device may refuse with BUSY."""
    kind = kind_of(name)
    return kind(**{item.name: b"a" if item.metadata["wire"].name == "u8[]" else 1 for item in fields(kind)})


def test_a_busy_device_handles_each_command_as_documented(talk: Talk) -> None:
    talk.home()
    talk.ask(LONG, msg.Started)
    for name, answer, busy, _ in sorted(rows("Commands at a glance"), key=lambda row: row[2] == "stops it"):
        since = len(talk.received)
        answered = talk.answer(simplest(name) if name != "StartScan" else LONG)
        if busy == "BUSY":
            assert isinstance(answered, msg.Refused), name
            assert answered.code == msg.Refusal.BUSY
        else:
            assert type(answered).__name__ == answer
            ends = [one.outcome for one in talk.messages(since) if isinstance(one, msg.Finished)]
            assert ends == ([msg.Outcome.STOPPED] if busy == "stops it" else [])
            if ends:
                talk.ask(LONG, msg.Started)


def test_an_angle_beyond_the_cable_is_refused_before_anything_turns(talk: Talk) -> None:
    talk.home()
    capabilities = talk.capabilities()
    beyond = [
        msg.Turn(capabilities.highest_angle + 1),
        msg.Turn(capabilities.lowest_angle - 1),
        msg.StartScan(capabilities.lowest_angle - 1, DEGREE, 2, 1, 1),
        msg.StartScan(capabilities.highest_angle - DEGREE, DEGREE, 3, 1, 1),
    ]
    assert [talk.ask(order, msg.Refused).code for order in beyond] == [msg.Refusal.OUT_OF_RANGE] * 4
    assert talk.act(msg.Turn(0))[2].outcome == msg.Outcome.DONE


def test_unknown_messages_are_refused_and_the_next_one_is_served(talk: Talk) -> None:
    for kind in (0x00, 0x7F, msg.Info.TYPE, msg.Heartbeat.TYPE, 0xFF):
        refused = talk.answer_to_frame(kind, b"\x01\x02\x03")
        assert isinstance(refused, msg.Refused)
        assert refused.code == msg.Refusal.UNKNOWN


def test_a_short_payload_is_malformed(talk: Talk) -> None:
    for kind in (msg.Configure, msg.Turn, msg.StartScan, msg.Resend, msg.TestLink):
        refused = talk.answer_to_frame(kind.TYPE, b"\x01")
        assert isinstance(refused, msg.Refused), kind
        assert refused.code == msg.Refusal.MALFORMED


def test_bytes_after_the_last_known_field_are_ignored(talk: Talk) -> None:
    request = msg.Configure(20_000, 2_380, 0, 343_200)
    assert isinstance(talk.answer_to_frame(msg.Configure.TYPE, request.pack() + b"more"), msg.Settings)


# turning


def test_homing_ends_at_zero_and_turns_end_at_the_requested_angle(talk: Talk) -> None:
    info = talk.greet()
    talk.home()
    for angle in (0, 40 * DEGREE, 10 * DEGREE, -20 * DEGREE, 0):
        answer, _, finished = talk.act(msg.Turn(angle))
        assert isinstance(answer, msg.Accepted)
        assert (finished.outcome, finished.readings, finished.text) == (msg.Outcome.DONE, 0, "")
        beat = talk.heartbeat()
        assert abs(beat.angle - angle) <= microstep(info)
        assert (beat.state, beat.homed, beat.boot) == (msg.State.IDLE, 1, info.boot)


def test_after_a_stopped_homing_the_zero_is_unknown(talk: Talk) -> None:
    talk.home()
    talk.act(msg.Turn(90 * DEGREE))
    since = len(talk.received)
    accepted, stopped, refused = talk.answers(msg.Home(), msg.Stop(), msg.Turn(0))
    assert isinstance(accepted, msg.Accepted)
    assert isinstance(stopped, msg.Accepted)
    (finished,) = [message for message in talk.messages(since) if isinstance(message, msg.Finished)]
    assert finished.outcome == msg.Outcome.STOPPED
    assert isinstance(refused, msg.Refused)
    assert refused.code == msg.Refusal.NOT_HOMED
    assert isinstance(talk.answer(TEN), msg.Refused)


# without homing


def forget_zero(talk: Talk) -> None:
    """Let the device forget its zero."""
    talk.answers(msg.Home(), msg.Stop())


def test_pings_in_place_need_no_zero_and_turn_nothing(talk: Talk) -> None:
    settings = talk.home()
    talk.act(msg.Turn(10 * DEGREE))
    here = msg.StartScan(0, DEGREE, 1, sweeps=3, pings=2, in_place=1)
    (at_ten,) = readings(talk.act(msg.StartScan(10 * DEGREE, DEGREE, 1, 1, 1))[1])
    for zero, angle in (msg.Zero.MARK, 10 * DEGREE), (msg.Zero.UNKNOWN, 0):
        if zero is msg.Zero.UNKNOWN:
            forget_zero(talk)
        assert (talk.heartbeat().homed, talk.heartbeat().angle) == (zero, angle)
        started, messages, finished = talk.act(here)
        assert isinstance(started, msg.Started)
        made = readings(messages)
        assert [(one.number, one.sweep, one.ping, one.angle) for one in made] == [
            (number, number // 2, number % 2, angle) for number in range(6)
        ]
        assert all(settings.blanking_us <= echo / 1000 <= settings.listen_us for one in made for echo in one.echoes)
        if zero is msg.Zero.MARK:
            assert all(one.echoes[0] == pytest.approx(at_ten.echoes[0], abs=NOISE) for one in made)
        assert finished.outcome == msg.Outcome.DONE
        assert talk.heartbeat().homed == zero


def test_a_zero_set_by_hand_is_the_present_angle_until_the_next_home(talk: Talk) -> None:
    talk.home()
    talk.act(msg.Turn(10 * DEGREE))
    (there,) = readings(talk.act(msg.StartScan(10 * DEGREE, DEGREE, 1, 1, 1))[1])
    assert isinstance(talk.answer(msg.SetZero()), msg.Accepted)
    assert (talk.heartbeat().homed, talk.heartbeat().angle) == (msg.Zero.HAND, 0)
    (here,) = readings(talk.act(msg.StartScan(0, DEGREE, 1, 1, 1))[1])
    assert here.echoes[0] == pytest.approx(there.echoes[0], abs=NOISE)
    talk.home()
    assert talk.heartbeat().homed == msg.Zero.MARK
    (there_again,) = readings(talk.act(msg.StartScan(10 * DEGREE, DEGREE, 1, 1, 1))[1])
    assert there_again.echoes[0] == pytest.approx(there.echoes[0], abs=NOISE)


def test_a_jog_turns_by_its_angle_without_a_zero_and_changes_no_zero(talk: Talk) -> None:
    talk.home()
    talk.act(msg.Turn(10 * DEGREE))
    (at_ten,) = readings(talk.act(msg.StartScan(10 * DEGREE, DEGREE, 1, 1, 1))[1])
    here = msg.StartScan(0, DEGREE, 1, 1, 1, in_place=1)
    assert talk.act(msg.Turn(-4 * DEGREE, relative=1))[2].outcome == msg.Outcome.DONE
    assert (talk.heartbeat().homed, talk.heartbeat().angle) == (msg.Zero.MARK, 6 * DEGREE)
    forget_zero(talk)
    (before,) = readings(talk.act(here)[1])
    assert talk.act(msg.Turn(8 * DEGREE, relative=1))[2].outcome == msg.Outcome.DONE
    assert talk.heartbeat().homed == msg.Zero.UNKNOWN
    (after,) = readings(talk.act(here)[1])
    assert talk.act(msg.Turn(-8 * DEGREE, relative=1))[2].outcome == msg.Outcome.DONE
    (back,) = readings(talk.act(here)[1])
    assert back.echoes[0] == pytest.approx(before.echoes[0], abs=NOISE)
    assert after.echoes[0] != pytest.approx(before.echoes[0], abs=NOISE)
    talk.home()
    (there,) = readings(talk.act(msg.StartScan(10 * DEGREE, DEGREE, 1, 1, 1))[1])
    assert there.echoes[0] == pytest.approx(at_ten.echoes[0], abs=NOISE)


def test_the_wiring_can_be_inverted_and_back(talk: Talk) -> None:
    talk.home()
    assert talk.ask(msg.ConfigureWiring(0, 0), msg.WiringSettings).inverted == 0
    assert talk.heartbeat().homed == msg.Zero.MARK
    try:
        assert (
            talk.ask(msg.ConfigureWiring(msg.Wiring.CAM, msg.Wiring.CAM), msg.WiringSettings).inverted == msg.Wiring.CAM
        )
        assert talk.heartbeat().homed == msg.Zero.UNKNOWN
        assert talk.ask(msg.ConfigureWiring(msg.Wiring.MARK, msg.Wiring.MARK), msg.WiringSettings).inverted == 3
    finally:
        assert talk.ask(msg.ConfigureWiring(7, 0), msg.WiringSettings).inverted == 0
    talk.home()
    assert msg.Input.CAM in msg.Input(talk.heartbeat().inputs)
    talk.act(msg.Turn(-90 * DEGREE))
    assert talk.heartbeat().inputs == 0


def test_one_switch_homes_by_the_mark_and_turns_less_than_half_a_turn(talk: Talk) -> None:
    before = talk.capabilities()
    if not before.features & msg.Feature.LOST_STEPS:
        pytest.skip("no home switches")
    talk.home()
    try:
        assert talk.ask(msg.ConfigureWiring(8, 8), msg.WiringSettings).inverted == msg.Wiring.ONE_SWITCH
        able = talk.capabilities()
        assert able.features == before.features | msg.Feature.ONE_SWITCH
        assert talk.heartbeat().homed == msg.Zero.UNKNOWN
        talk.home()
        for angle in (able.highest_angle, able.lowest_angle, 90 * DEGREE):
            assert abs(angle) < 178 * DEGREE
            assert talk.act(msg.Turn(angle))[2].outcome == msg.Outcome.DONE
            assert bool(msg.Input(talk.heartbeat().inputs) & msg.Input.MARK) == (angle > 0)
        assert talk.ask(msg.Turn(able.highest_angle + 1), msg.Refused).code == msg.Refusal.OUT_OF_RANGE
        talk.home()
    finally:
        assert talk.ask(msg.ConfigureWiring(8, 0), msg.WiringSettings).inverted == 0
    after = talk.capabilities()
    assert after == replace(before, command=after.command)
    talk.home()


# scanning


def check_scan(order: msg.StartScan, made: list[msg.ReadingMessage], settings: msg.Settings, info: msg.Info) -> None:
    """Assert that each reading arrives once, in order, at its angle, with all echoes within the listening time."""
    last = order.first + order.count if order.count else order.headings * order.sweeps * order.pings
    assert [reading.number for reading in made] == list(range(order.first, last))
    plan = ScanOrder(order.start, order.step, order.headings, order.sweeps, order.pings)
    for reading in made:
        sweep, angle, ping = plan.ping_at(reading.number)
        assert (reading.sweep, reading.ping) == (sweep, ping)
        assert abs(reading.angle - angle) <= microstep(info)
        assert list(reading.echoes) == sorted(reading.echoes)
        assert all(settings.blanking_us <= echo / 1000 <= settings.listen_us for echo in reading.echoes)


@pytest.mark.parametrize(
    "order",
    [
        TEN,
        msg.StartScan(0, DEGREE, 6, 1, 3),
        msg.StartScan(20 * DEGREE, -7 * DEGREE, 6, 1, 1),
        msg.StartScan(0, 3 * DEGREE, 6, 2, 2, first=5, count=9),
        msg.StartScan(0, 3 * DEGREE, 6, 1, 1, first=5),
        msg.StartScan(0, 3 * DEGREE, 6, 1, 1, first=4, count=2),
    ],
    ids=short,
)
def test_a_scan_measures_each_reading_once_at_its_angle(talk: Talk, order: msg.StartScan) -> None:
    info, settings = talk.greet(), talk.home()
    started, messages, finished = talk.act(order)
    made = readings(messages)
    assert isinstance(started, msg.Started)
    assert (started.readings, started.first) == (len(made), order.first)
    check_scan(order, made, settings, info)
    assert (finished.outcome, finished.readings) == (msg.Outcome.DONE, made[-1].number + 1)


def test_the_ping_period_is_kept_within_a_scan_and_between_scans(talk: Talk) -> None:
    talk.home()
    period = talk.capabilities().ping_period_us
    fired = [reading.fired_us for _ in range(2) for reading in readings(talk.act(TEN)[1])]
    assert all(later - earlier >= period for earlier, later in itertools.pairwise(fired))


def test_a_stopped_scan_ends_before_stop_is_answered(talk: Talk) -> None:
    talk.home()
    since = len(talk.received)
    number, stop = talk.send(LONG, msg.Stop())
    messages = talk.until(lambda all: any(isinstance(m, msg.Accepted) and m.command == stop for m in all), since)
    ends = [message for message in messages if isinstance(message, msg.Finished | msg.Accepted)]
    assert [(type(message), message.command) for message in ends] == [(msg.Finished, number), (msg.Accepted, stop)]
    (finished,) = [message for message in ends if isinstance(message, msg.Finished)]
    assert finished.outcome == msg.Outcome.STOPPED
    assert finished.readings == len(readings(messages))


def test_hello_ends_the_running_scan_and_keeps_zero_and_readings(talk: Talk) -> None:
    talk.home()
    talk.ask(msg.Configure(20_000, 2_380, 0, 345_678), msg.Settings)
    talk.ask(LONG, msg.Started)
    made = readings(talk.until(lambda received: len(readings(received)) == 3))
    assert talk.greet().homed == 1
    since = len(talk.received)
    talk.ask(msg.Resend(0, 2), msg.Accepted)
    talk.until(lambda received: readings(received) == made[:2], since)
    assert talk.act(msg.Turn(0))[2].outcome == msg.Outcome.DONE


def test_a_repeated_command_is_executed_once_and_answered_twice(talk: Talk) -> None:
    talk.home()
    since = len(talk.received)
    wire = talk.wire(TEN.TYPE, TEN.pack())
    talk.write(wire + wire)
    talk.until(lambda received: sum(isinstance(message, msg.Started) for message in received) == 2, since)
    messages = talk.until(lambda received: any(isinstance(message, msg.Finished) for message in received), since)
    assert [reading.number for reading in readings(messages)] == list(range(10))
    again = len(talk.received)
    talk.write(wire)
    messages = talk.until(lambda received: any(isinstance(message, msg.Finished) for message in received), again)
    assert any(isinstance(message, msg.Started) for message in messages)
    assert readings(messages) == []
    assert talk.ask(msg.Resend(0, 10), msg.Accepted)


def test_readings_are_resent_unchanged_without_a_new_measurement(talk: Talk) -> None:
    talk.home()
    made = readings(talk.act(TEN)[1])
    pings = talk.ask(msg.AskStatistics(), msg.Statistics).pings
    since = len(talk.received)
    talk.ask(msg.Resend(3, 4), msg.Accepted)
    talk.until(lambda received: len(readings(received)) == 4, since)
    talk.ask(msg.Resend(10, 4), msg.Accepted)  # of a reading that was never made
    assert talk.ask(msg.AskStatistics(), msg.Statistics).pings == pings
    assert readings(talk.messages(since)) == made[3:7]


def test_a_limit_on_echoes_keeps_the_earliest(talk: Talk) -> None:
    talk.home()
    all_of_them = readings(talk.act(TEN)[1])
    assert talk.ask(msg.Configure(20_000, 2_380, 0, 343_200, echoes=1), msg.Settings).echoes == 1
    for before, after in zip(all_of_them, readings(talk.act(TEN)[1]), strict=True):
        assert len(after.echoes) <= 1 <= max(1, len(before.echoes))


# time


def test_heartbeats_come_every_quarter_second_during_every_activity(talk: Talk) -> None:
    talk.home()
    talk.act(msg.Turn(90 * DEGREE))
    talk.act(msg.Home())
    talk.act(msg.StartScan(0, DEGREE, 15, 1, 1))
    since = len(talk.received)
    talk.until(lambda received: sum(isinstance(message, msg.Heartbeat) for message in received) >= 3, since)
    times = [item.frame.time_us / 1e6 for item in talk.received if isinstance(item.message, msg.Heartbeat)]
    # heartbeats may be late: the device sends nothing while it listens
    assert all(0.15 < later - earlier < 0.35 for earlier, later in itertools.pairwise(times))


def test_the_conversation_with_a_silent_host_ends_until_the_next_hello(talk: Talk) -> None:
    talk.home()
    quiet = 1.0  # s
    while not isinstance(answer := after_quiet(talk, quiet), msg.Refused):  # the device was only slow
        quiet *= 2
    assert answer.code == msg.Refusal.NO_HELLO
    # the turntable may have been turned by hand meanwhile
    assert talk.greet().homed == 0
    assert talk.ask(msg.Turn(0), msg.Refused).code == msg.Refusal.NOT_HOMED


def after_quiet(talk: Talk, quiet: float) -> msg.Message:
    """Send nothing until nothing has been received for `quiet` s; return the answer to Stop."""
    while talk.quiet(quiet):
        pass
    return talk.answer(msg.Stop())


@pytest.mark.direct
def test_a_host_of_version_1_0_may_be_silent(talk: Talk) -> None:
    talk.home()
    talk.ask(msg.Hello(PROTOCOL_MAJOR, 0), msg.Info)
    assert [type(message) for message in talk.quiet(10.01)] == [msg.Heartbeat] * 40
    assert talk.ask(msg.Turn(0), msg.Accepted)


@pytest.mark.direct
@pytest.mark.parametrize("silent_for", [0.45, 0.55])  # the line looks at most every 0.02 s
def test_a_baud_rate_without_a_valid_frame_ends(talk: Talk, line: OpenLine, silent_for: float) -> None:
    talk.ask(msg.SetBaud(1_000_000), msg.Accepted)
    assert line.baud == 1_000_000
    talk.write(b"\x55" * 300 + b"\0")
    talk.quiet(silent_for)
    assert line.baud == (1_000_000 if silent_for < BAUD_TIMEOUT else 250_000)
    talk.ask(msg.SetBaud(1_000_000), msg.Accepted)
    talk.ask(msg.AskStatistics(), msg.Statistics)
    talk.quiet(1.0)
    assert line.baud == 1_000_000
    talk.quiet(HOST_SILENCE)
    assert line.baud == 250_000
