"""Schedules of faults as docs/devices/faults.md states; a session under each recovers, or ends with an error."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from sonarhw.device.fake_board import FakeBoard
from sonarhw.device.faults import KNOWN, Event, FaultKind, Faults, LineNoise, read_faults
from sonarhw.errors import DeviceError, Incompatible, InputError, LinkLost, NoAnswer, SonarError
from sonarhw.host.scripts import homing, scanning, turning
from sonarhw.log import LogWriter, read_log
from sonarhw.wire import messages as msg
from sonarhw.wire.frames import Frame, FrameDecoder, encode_frame
from tests.checkout import CHECKOUT
from tests.contract.talk import DirectLine, Talk, readings
from tests.fixtures.bench import Bench
from tests.fixtures.example_logs import METADATA
from tests.fixtures.faulty_boards import faulty
from tests.fixtures.plain_echoes import assert_scanned

DOCUMENT = (CHECKOUT / "docs" / "devices" / "faults.md").read_text(encoding="utf-8")
SECTOR = msg.StartScan(start=10_000_000, step=2_500_000, headings=40, sweeps=2, pings=1)


# the text


def test_the_table_of_the_document_lists_every_fault_with_its_default_size() -> None:
    rows = re.findall(r"^\| `(\w+)=\w+[\w.]*` \|.*\| (.*?) ?\|$", DOCUMENT, flags=re.MULTILINE)
    assert [name for name, _ in rows] == list(KNOWN)
    for kind in FaultKind:
        default = dict(rows)[kind.text]
        assert kind.size == (math.inf if default == "for ever" else float(default))
    specs = re.findall(r'--faults (\S+)$|read_faults\("(.*?)"\)|`(\w+=\S+@\S+)`', DOCUMENT, flags=re.MULTILINE)
    assert len(specs) == 3
    assert all(read_faults("".join(groups)) != Faults() for groups in specs)


@pytest.mark.parametrize(
    ("spec", "faults"),
    [
        ("", Faults()),
        ("drop=0,flip=1,drift=-100000", Faults(drop=0.0, flip=1.0, drift=-100_000.0)),
        ("drop=1/5000,flip=1e-4,drift=-20,protocol=0.9", Faults(1 / 5000, 1e-4, drift=-20, protocol=(0, 9))),
        ("protocol=255.255", Faults(protocol=(255, 255))),
        ("reset@r20", Faults(events=(Event(FaultKind.RESET, 0.5, pings=20),))),
        ("stall=0.4@12.5,stall=0@0", Faults(events=(Event(FaultKind.STALL, 0.4, 12.5), Event(FaultKind.STALL, 0, 0)))),
        ("unplug=2@~30", Faults(events=(Event(FaultKind.UNPLUG, 2.0, 30, repeats=True),))),
        ("wedge", Faults(events=(Event(FaultKind.WEDGE, math.inf, 0),))),
    ],
)
def test_a_schedule_is_parsed_from_its_text(spec: str, faults: Faults) -> None:
    assert read_faults(spec) == faults


@pytest.mark.parametrize(
    "spec",
    [
        *("rust=1", "Drop=0.1", "drop", "drop=x", "drop=2", "drop=-1", "drop=1/0", "drop=nan"),
        *("flip=0.1@5", "drop=0,drop=0", "drift=1e9"),
        *("protocol=1", "protocol=1.x", "protocol=1.300", "stall=-1", "reset=inf", "slip=1e99"),
        *("reset@", "reset@never", "reset@-1", "reset@r", "reset@r1.5", "reset@~0", "reset@~-3"),
    ],
)  # fmt: skip
def test_an_invalid_schedule_is_refused_with_an_error_of_one_line(spec: str) -> None:
    with pytest.raises(InputError, match="fault ") as refused:
        read_faults(spec)
    assert "\n" not in str(refused.value)


# the line


@pytest.mark.parametrize("name", ["drop", "flip", "insert"])
def test_the_requested_share_of_bytes_is_damaged(name: str) -> None:
    sent = bytes(range(1, 251)) * 4000  # a million
    arrived = LineNoise(Faults(**{name: 1 / 1000}), seed=4).damage(sent)
    flipped = [a ^ b for a, b in zip(sent, arrived, strict=True) if a != b] if name == "flip" else []
    assert all(change.bit_count() == 1 for change in flipped)
    changes = len(flipped) or abs(len(sent) - len(arrived))
    assert changes == pytest.approx(1000, abs=5 * math.sqrt(1000))
    assert name == "flip" or (len(arrived) > len(sent)) == (name == "insert")


def test_damage_depends_on_the_seed_and_not_on_the_pieces_of_the_stream() -> None:
    faults, sent = Faults(drop=0.01, flip=0.02, insert=0.01), bytes(range(250)) * 20
    whole, in_pieces = LineNoise(faults, seed=9), LineNoise(faults, seed=9)
    assert whole.damage(sent) == b"".join(in_pieces.damage(sent[at : at + 7]) for at in range(0, len(sent), 7))
    assert LineNoise(faults, seed=10).damage(sent) != LineNoise(faults, seed=9).damage(sent)


def talk_to(spec: str, homed: bool = True) -> Talk:
    """Return a conversation with a board with these faults."""
    line = DirectLine(faulty(spec))
    talk = Talk(line, line.clock)
    talk.ask(msg.Hello(1, 1), msg.Info)
    if homed:
        talk.act(msg.Home())
    return talk


def test_a_stalled_line_loses_nothing_and_releases_everything_at_once() -> None:
    talk, arrivals = talk_to("stall=0.4@r3"), dict[int, float]()
    talk.send(msg.StartScan(0, 1_000_000, 12, 1, 1))
    while len(arrivals) < 12:
        talk.listen()
        arrivals.update({one.number: talk.clock() for one in readings(talk.messages()) if one.number not in arrivals})
    assert [arrivals[4], arrivals[5], arrivals[6]] == pytest.approx([arrivals[2] + 0.4] * 3, abs=0.01)


def test_bytes_that_wait_in_a_stalled_line_arrive_once_also_after_several_stalls() -> None:
    talk = talk_to("stall=0.4@1,stall=0.4@2,stall=0.4@3", homed=False)
    for sent in range(2, 20):
        assert talk.ask(msg.AskStatistics(), msg.Statistics).frames == sent
        talk.quiet(0.2)


def test_a_drifting_clock_gives_other_times_than_the_host() -> None:
    device, host = [], []
    for spec in ("drift=0", "drift=500"):
        bench = Bench(faulty(spec)).connect()
        bench.do(homing())
        times = [reading.time for reading in bench.scanned(msg.StartScan(0, 1_000_000, 50, 1, 1))]
        device.append(times[-1] - times[0])
        talk = talk_to(spec)
        began = talk.clock()
        talk.act(msg.StartScan(0, 1_000_000, 50, 1, 1))
        host.append(talk.clock() - began)
    # the ping period is unchanged on the clock of the board, but not on the clock of the host
    assert device[1] == pytest.approx(device[0], abs=2e-6)
    assert host[1] == pytest.approx(host[0] / 1.0005, rel=1e-4)


# the board


def test_homing_a_jammed_turntable_is_an_error_until_it_is_released() -> None:
    talk = talk_to("wedge=3", homed=False)
    finished = talk.act(msg.Home())[2]
    assert finished.outcome == msg.Outcome.FAULT
    assert "zero mark was not found" in finished.text
    talk.until(lambda _: talk.clock() > 4)
    assert talk.act(msg.Home())[2].outcome == msg.Outcome.DONE


@pytest.mark.parametrize("fault", ["slip=100@r5", "slip=-3@r5", "wedge=0.2@r5", "wedge@r5"])
def test_missed_steps_are_detected_at_the_zero_mark_and_end_the_scan(fault: str) -> None:
    talk = talk_to(fault)
    finished = talk.act(msg.StartScan(-10_000_000, 2_000_000, 12, 4, 1))[2]
    # each sweep passes the mark once; readings are verified up to the previous pass
    assert finished.outcome == msg.Outcome.LOST_STEPS
    assert finished.readings <= 5 + 12
    assert "microsteps from its place" in finished.text
    assert talk.ask(msg.Turn(0), msg.Refused).code == msg.Refusal.NOT_HOMED
    assert talk.ask(msg.AskStatistics(), msg.Statistics).lost_steps > 0


def test_a_reset_clears_the_state_of_the_board() -> None:
    talk = talk_to("reset=0.5@r3")
    talk.send(msg.StartScan(0, 1_000_000, 20, 1, 1))
    talk.until(lambda received: len(readings(received)) == 3)
    assert talk.quiet(0.4) == []
    talk.quiet(0.2)
    info = talk.ask(msg.Hello(1, 0), msg.Info)
    frame = next(item.frame for item in talk.received if item.message is info)
    assert (frame.sequence, frame.time_us < 200_000) == (0, True)


def test_a_board_with_faults_sends_no_frame_early_however_often_its_line_is_read() -> None:
    device, decoder = faulty(""), FrameDecoder()
    device.receive(encode_frame(Frame(msg.Hello.TYPE, 1, 0, msg.Hello(1, 1).pack())), 0.0)
    heartbeats = 0
    for now in np.arange(0.0, 1.02, 0.01):
        for frame in decoder.feed(device.advance(float(now))):
            assert now - 0.011 < frame.time_us * 1e-6 <= now + 1e-6
            heartbeats += frame.type == msg.Heartbeat.TYPE
    assert heartbeats in (3, 4)  # one every quarter of a second


@pytest.mark.parametrize(("spec", "name", "apart"), [("wedge=5@~5", "wedge", 10.0), ("slip=500@~5", "slip", 5.0)])
def test_a_repeated_fault_waits(spec: str, name: str, apart: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """The size of a jam is its duration; that of a slip is not a time."""
    times: list[float] = []
    device = faulty(spec)
    monkeypatch.setattr(FakeBoard, name, lambda _board, _size: times.append(now))
    for now in np.arange(0.0, 1000.0, 0.05):
        device.advance(float(now))
    assert np.diff(times).mean() == pytest.approx(apart, rel=0.25)
    assert name == "slip" or np.diff(times).min() >= 4.9


# a session

RECOVERABLE = [
    "drop=1/3000,flip=1/3000,insert=1/3000",
    *("drift=200", "drift=-5000", "protocol=1.0", "protocol=1.9"),
    *("stall=0.4@r20", "stall=0.7@~2", "stall=2@r20", "stall=6@~15"),
    *("deaf=0.3@r20", "deaf@~3", "deaf=4@r20", "mute=0.3@r20", "mute@~5", "mute=4@r20"),
    *("reset=0.01@r20", "reset@r1", "reset=2@~8", "reset@r20,drop=1/3000"),
    *("nonsense=0.3@r20", "nonsense=3@r20"),
    *("unplug=0.2@r20", "unplug=8@r60", "unplug@~5", "unplug@r20,reset=1.5@r20", "move@r20", "move@~6,reset@~11"),
    "stall=0.5@~9,reset@~17,unplug@~13,drop=1/5000,flip=1/5000,drift=300",
]  # fmt: skip
UNRECOVERABLE = {
    "wedge": (DeviceError, "zero mark was not found"),
    "wedge@r20": (DeviceError, "zero mark"),
    "slip=3@r20": (DeviceError, "3 microsteps from its place"),
    "protocol=0.9": (Incompatible, r"0\.9"),
    "protocol=2.0": (Incompatible, r"2\.0"),
    "nonsense": (NoAnswer, "no scanner answered"),
    "nonsense@r20": (SonarError, "did not come back within 30 s"),
    "unplug=1000@r20": (LinkLost, "did not come back within 30 s"),
    "drop=1": (NoAnswer, "no scanner answered"),
}


@pytest.mark.parametrize("faults", RECOVERABLE)
def test_recoverable_faults_lose_and_repeat_no_reading_and_the_log_contains_all(faults: str, tmp_path: Path) -> None:
    path, bench = tmp_path / "scan.mcap", Bench(faulty(faults))
    with LogWriter(path, METADATA) as log:
        bench.session.recording.use(log)
        delivered = bench.scanned(SECTOR, trace=True)
    assert_scanned(delivered, SECTOR)
    recorded = read_log(path)
    assert recorded.torn is None
    assert len(recorded.readings) == 80
    kept = {reading.number: reading for reading in recorded.readings}
    for reading in delivered:
        assert (kept[reading.number].angle, kept[reading.number].echo_times) == (reading.angle, reading.echo_times)
        # after a reset, the time is continued from the received frames; a log contains only some of them
        assert kept[reading.number].time == pytest.approx(reading.time, abs=0.01)


@pytest.mark.parametrize("faults", [spec for spec in RECOVERABLE if "unplug" in spec or "move" in spec])
def test_they_lose_and_repeat_none_also_if_the_port_stays(faults: str) -> None:
    assert_scanned(Bench(faulty(faults), vanishes=False).scanned(SECTOR), SECTOR)


@pytest.mark.parametrize("faults", ["deaf=4@1.7", "stall=4@1.7", "mute=4@1.7", "reset@1.7", "unplug@1.7"])
def test_an_interrupted_turn_is_completed(faults: str) -> None:
    bench = Bench(faulty(faults))
    bench.do(homing())
    for angle in (700_000_000, 10_000_000):  # each takes 4 s
        assert bench.do(turning(msg.Turn(angle))).result is msg.Outcome.DONE
    assert_scanned(bench.scanned(SECTOR), SECTOR)


@pytest.mark.parametrize(("faults", "expected"), UNRECOVERABLE.items(), ids=UNRECOVERABLE.keys())
def test_unrecoverable_faults_give_an_error_of_one_line(faults: str, expected: tuple[type[SonarError], str]) -> None:
    bench = Bench(faulty(faults))
    job = scanning(msg.StartScan(-10_000_000, 2_500_000, 10, 40, 1))
    with pytest.raises(expected[0], match=expected[1]) as error:
        bench.do(job, within=120)
    assert "\n" not in str(error.value)
    assert expected[0] is not NoAnswer or (job.readings, bench.session.device.info) == (type(job.readings)(), None)


def test_each_reset_is_counted_as_one_start_of_the_board() -> None:
    bench = Bench(faulty("reset@r20,reset@r40"))
    bench.scanned(SECTOR)
    assert bench.session.device.info.boot == 3
