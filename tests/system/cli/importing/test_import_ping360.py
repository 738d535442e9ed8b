"""`sonarhw import` of the logs of Ping Viewer with profiles of a Ping360."""

import math
import struct
from pathlib import Path

import numpy as np
import pytest
from sonarhw_cli.app import run

from sonarhw.log import read_log
from tests.system.cli.importing.test_import_text import degrees


def text_of_qt(text: str) -> bytes:
    content = text.encode("utf-16-be")
    return struct.pack(">I", len(content)) + content


def ping_message(number: int, payload: bytes) -> bytes:
    """A message of the Ping protocol (docs.bluerobotics.com/ping-protocol): BR, length, number, ids, sum of bytes."""
    frame = struct.pack("<2sHHBB", b"BR", len(payload), number, 1, 0) + payload
    return frame + struct.pack("<H", sum(frame) & 0xFFFF)


def profile(gradians: int, samples: bytes, automatic: bool) -> bytes:
    head = struct.pack("<BBHHHH", 1, 0, gradians, 80, 80, 750)  # a sample each 80 · 25 ns = 2 µs
    if automatic:
        return ping_message(2301, head + struct.pack("<HHBBHH", 0, 399, 1, 0, len(samples), len(samples)) + samples)
    return ping_message(2300, head + struct.pack("<HH", len(samples), len(samples)) + samples)


def ping360_log(*messages: tuple[str, bytes]) -> bytes:
    """A log as Ping Viewer writes it: src/link/logsensorstruct.cpp and examples/decode_sensor_binary_log.py."""
    header = text_of_qt("PingViewer sensor log file") + struct.pack(">i", 1)
    header += b"".join(map(text_of_qt, ("a1e1cb2", "2019-09-24", "v2.0.4", "Debian", "12"))) + struct.pack(">ii", 1, 2)
    return header + b"".join(text_of_qt(time) + struct.pack(">I", len(message)) + message for time, message in messages)


def ringing(echo: int) -> bytes:
    samples = np.full(1000, 10, np.uint8)
    samples[:50], samples[echo : echo + 20] = 255, 200
    return samples.tobytes()


LOG_360 = ping360_log(
    ("23:59:59.900", profile(100, ringing(400), automatic=False)),
    ("23:59:59.950", ping_message(4, b"\1\0\0\0\0\0")),
    ("00:00:00.100", profile(101, ringing(500), automatic=True)),
)


def ping360(folder: Path, content: bytes, *options: str) -> int:
    (folder / "sonar.bin").write_bytes(content)
    return run(["import", str(folder / "sonar.bin"), "--out", str(folder / "out.mcap"), *options])


def test_profiles_of_a_ping360_are_traces_with_the_first_loud_sample_as_echo(tmp_path: Path) -> None:
    options = ["--threshold", "0.5", "--blanking", "0.0002", "--speed-of-sound", "1500"]
    assert ping360(tmp_path, LOG_360, *options) == 0
    readings = read_log(tmp_path / "out.mcap").readings
    assert degrees(readings) == pytest.approx([90.0, 90.9], abs=1e-5)
    assert [one.range for one in readings] == [pytest.approx(k * 2e-6 * 750, abs=2e-6) for k in (400, 500)]
    assert readings[1].time - readings[0].time == pytest.approx(0.2, abs=1e-5)
    trace = readings[1].trace
    assert trace.rate == pytest.approx(500_000)
    assert (trace.samples * 255).round().astype(np.uint8).tobytes() == ringing(500)


# messages 2300, 2301 and 4 packed by bluerobotics-ping 0.2.5, in the file of Ping Viewer's encode_sensor_binary_log.py
BY_BLUE_ROBOTICS = """\
0000001a50696e675669657765722073656e736f72206c6f672066696c650000000100000007303235383365310000000a32
3032342d30312d30310000000676322e342e30000000065562756e74750000000532322e303400000002000000020000000c
31323a30303a30302e3235300000002042521600fc0800000101640064006400ee0208000800ff050505dc090505d9050000
000c31323a30303a30312e3235300000002642521c00fd08000001018f0164006400ee0200008f01010008000800ff050505
dc0905059d060000000c31323a30303a30392e3030300000001042520600040000000000000000009e00"""


def test_messages_of_blue_robotics_own_library_are_read(tmp_path: Path) -> None:
    options = ["--threshold", "0.5", "--blanking", "0.000006", "--speed-of-sound", "1500"]
    assert ping360(tmp_path, bytes.fromhex(BY_BLUE_ROBOTICS.replace("\n", "")), *options) == 0
    readings = read_log(tmp_path / "out.mcap").readings
    assert degrees(readings) == pytest.approx([90.0, 359.1], abs=1e-4)
    # the fifth sample, 220, is the first loud one after blanking: 4 periods of 100 · 25 ns
    assert [one.range for one in readings] == [pytest.approx(4 * 100 * 25e-9 * 750, abs=1e-6)] * 2
    assert readings[1].time - readings[0].time == pytest.approx(1.0, abs=1e-5)
    for reading in readings:
        assert (reading.trace.samples * 255).round().tolist() == [255, 5, 5, 5, 220, 9, 5, 5]


def test_damaged_messages_are_left_out_and_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A quarter of the messages is damaged: a bit, a length, the time, a cut; all others are read."""
    rng = np.random.default_rng(5)
    times = [f"10:00:{k:02}.000" for k in range(40)]
    messages = [profile(k, ringing(400), automatic=True) for k in range(40)]
    damaged = {int(k) for k in rng.choice(np.arange(1, 39), 10, replace=False)}
    log = bytearray(ping360_log())
    for k, (time, message) in enumerate(zip(times, messages, strict=True)):
        record = bytearray(text_of_qt(time) + struct.pack(">I", len(message)) + message)
        if k in damaged:
            kind = k % 4
            if kind == 0:
                record[200] ^= 4
            elif kind == 1:
                record[0] = 0x7F  # the length of the time
            elif kind == 2:
                del record[300:500]
            else:
                record[len(text_of_qt(time))] = 0x11  # the length of the message
        log += record
    assert ping360(tmp_path, bytes(log)) == 0
    headings = [round(math.degrees(one.angle) / 0.9) for one in read_log(tmp_path / "out.mcap").readings]
    assert headings == [k for k in range(40) if k not in damaged]
    assert "damaged messages left out" in capsys.readouterr().err


def test_without_a_threshold_profiles_have_no_echo_and_a_torn_log_gives_those_before(tmp_path: Path) -> None:
    assert ping360(tmp_path, LOG_360[:-100]) == 0
    (reading,) = read_log(tmp_path / "out.mcap").readings
    assert reading.range is None
    assert reading.trace is not None


@pytest.mark.parametrize(
    ("content", "options", "message"),
    [
        (b"", [], "has no header of Ping Viewer"),
        (b"\xff" * 100, [], "has no header of Ping Viewer"),
        (b"\0\0\xff\xff" * 100, [], "has no header of Ping Viewer"),
        (b"\7" * 1000, [], "a text or message of 117901063 bytes; expected a log of Ping Viewer"),
        (ping360_log(), [], "has no profile of a Ping360"),
        (ping360_log(("noon", b"")), [], "message 1: has no time hh:mm:ss.zzz"),
        (ping360_log(("00:00:00.000", b"BR")), [], "message 1: 2 bytes; expected a message of the Ping protocol"),
        (ping360_log(("00:00:00.000", ping_message(2300, b"\0\0"))), [], "message 1: a profile of 2 bytes"),
        (ping360_log(("00:00:00.000", profile(0, b"", False))), [], "message 1: a profile of 0 samples"),
        (LOG_360, ["--threshold", "2"], "--threshold 2: expected a share of full scale"),
        (LOG_360, ["--blanking", "0.1"], "--blanking 0.1: expected 0 to 1 s, and a threshold"),
        (LOG_360, ["--no-echo", "1"], "--no-echo 1: only for formats with ranges"),
        (LOG_360, ["--speed-of-sound", "0"], "--speed-of-sound 0: expected 100 to 10000 m/s"),
    ],
)
def test_a_wrong_ping360_log_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: bytes, options: list[str], message: str
) -> None:
    assert ping360(tmp_path, content, *options) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out.mcap").exists()
