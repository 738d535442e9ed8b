"""`sonarhw scan`, `ports --guess` and other commands with a device that prints text on a pseudo-terminal."""

import json
import re
import signal
from collections.abc import Iterable, Iterator
from itertools import chain, cycle, repeat
from pathlib import Path
from urllib.parse import quote

import pytest
from sonarhw_cli.app import run

from sonarhw import Scanner, text_device
from sonarhw.device.fake_board import FakeBoard
from sonarhw.device.served import serve
from sonarhw.errors import NoAnswer
from sonarhw.host import scanner
from sonarhw.link import Port
from sonarhw.log import read_log
from sonarhw.text_device import read_lines_url
from tests.fixtures.commands import end, lines, started
from tests.fixtures.plain_echoes import PlainEchoes
from tests.fixtures.text_devices.printing_device import SKETCHES, PrintingDevice, wall
from tests.fixtures.text_devices.received_clock import ReceivedClock
from tests.hang_guard import HANG
from tests.reference_pages import keys_in_reference

RADAR_LINES = [b"%d,23\n" % abs(step) for step in range(-10, 10)]
RADAR = SKETCHES["radar 15 to 165"]


def test_a_scan_reports_what_it_ignored(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "scan.mcap"
    with PrintingDevice(RADAR.rounds()) as device:
        assert run(["scan", f"lines:{device.port}?preset=arduino-radar", "--out", str(log), "--print"]) == 0
    out, err = capsys.readouterr()
    readings, rows = read_log(log).readings, [line.split(",") for line in out.splitlines()[1:]]
    assert len(readings) == len(rows) in (150, 151)
    echoes = sum(reading.range is not None for reading in readings)
    counted, ignored, *_ = err.splitlines()
    assert counted == f"{len(readings)} readings, {echoes} with an echo, in {log}"
    assert ignored.startswith("ignored: half lines (1)")
    assert read_log(log).metadata.board == "hc-sr04"
    for _, heading, distance, *_ in rows:
        true = wall(float(heading))
        assert (float(distance) if distance else None) == (None if true is None else pytest.approx(true / 100))


def test_the_plain_port_of_a_device_that_prints_text_says_how_to_find_its_url(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scanner, "time", ReceivedClock(monkeypatch, 100))
    with (
        PrintingDevice(RADAR.rounds()) as device,
        pytest.raises(NoAnswer, match=r"Listen for text.*sonarhw ports --guess PORT"),
    ):
        Scanner.open(device.port)


def test_monitor_prints_bytes_and_readings_until_it_is_interrupted() -> None:
    with (
        PrintingDevice(RADAR.rounds()) as device,
        started("monitor", f"lines:{device.port}?preset=arduino-radar") as monitor,
    ):
        printed = ""
        while not re.search(r"^ +\d+\.\d{3}  (\d+)\.0°  (\d\.\d{3} m|no echo)\n", printed, flags=re.MULTILINE):
            (line,) = lines(monitor, 1)
            printed += line
        monitor.send_signal(signal.SIGINT)
        status, closing = end(monitor)
    assert re.match(r" +\d+\.\d{3}  b'[\d,.]+'\n", printed)
    assert status == 130
    assert re.fullmatch(r"lines:.*: \d+ readings?, half lines \(1\)\n", closing)


def test_info_states_that_there_is_no_protocol(capsys: pytest.CaptureFixture[str]) -> None:
    with PrintingDevice(RADAR.rounds()) as device:
        assert run(["info", f"lines:{device.port}?preset=arduino-radar"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "firmware      text lines, arduino-radar"
    assert lines[1] == "protocol      none; it prints readings"
    assert lines[-1] == "ignored       half lines (1)"


# a pattern of the user's own has no preset
PRESETS = [(name, found[1]) for name, one in SKETCHES.items() if (found := re.search(r"preset=([\w-]+)", one.query))]


@pytest.mark.parametrize(("name", "preset"), PRESETS)
def test_guess_proposes_a_url(name: str, preset: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with PrintingDevice(SKETCHES[name].rounds()) as device:
        assert run(["ports", "--guess", "--json", device.port]) == 0
        (found,) = json.loads(capsys.readouterr().out)["ports"]
        assert (found["preset"], found["baud"]) == (preset, 9600)
        assert found["answer"] == f"prints {preset} at 9600 baud: '{found['proposed_url']}'"
        assert (found["undecided"], found["questions"]) == ([], [])
        assert found["answered_urls"] == [found["proposed_url"]]
        assert any("readings, angles" in fact for fact in found["evidence"])
        log = tmp_path / "scan.mcap"
        assert run(["scan", found["proposed_url"], "--out", str(log)]) == 0
    assert len(read_log(log).readings) >= 33
    assert set(found) == keys_in_reference("### `sonarhw ports --guess")


def test_guess_finds_a_rangefinder_without_angle(capsys: pytest.CaptureFixture[str]) -> None:
    with PrintingDevice(b"R%04d\r" % k for k in range(500, 5000)) as device:
        assert run(["ports", "--guess", device.port]) == 0
        turn = "the turn of the table between two readings"
        undecided = f"no angle is printed; DEGREES is {turn}: add step=DEGREES"
        url = f"lines:{device.port}?baud=9600&preset=maxbotix&unit=mm"
    out, err = capsys.readouterr()
    first, *details = out.splitlines()
    assert err.endswith(f"next, with your answer: sonarhw scan '{url}&step=DEGREES' --out scan.mcap\n")
    assert first == f"{device.port}  prints maxbotix at 9600 baud; undecided: {undecided}: '{url}'"
    assert details[0] == "    range in millimetres: four digits"


def undecided() -> Iterator[bytes]:
    """Print ranges in yards, without their unit."""
    return (b"%d\t%.2f\r\n" % (a, 0.8 + a % 37 / 20) for a in cycle([*range(0, 181, 5), *range(175, 0, -5)]))


def test_guess_gives_the_url_with_each_answer(capsys: pytest.CaptureFixture[str]) -> None:
    with PrintingDevice(undecided()) as device:
        assert run(["ports", "--guess", "--json", device.port]) == 0
        (found,) = json.loads(capsys.readouterr().out)["ports"]
        assert run(["ports", "--guess", device.port]) == 0
    answers = [{"unit": "m"}, {"unit": "ft"}, {"unit": "yd"}]
    assert [question["answers"] for question in found["questions"]] == [answers]
    assert found["undecided"] == [f"{found['questions'][0]['problem']}: add unit=m, unit=ft or unit=yd"]
    urls = found["answered_urls"]
    assert [read_lines_url(url).layout.unit for url in urls] == ["m", "ft", "yd"]
    assert capsys.readouterr().err.splitlines()[-3:] == [
        f"next, with your answer: sonarhw scan '{urls[0]}' --out scan.mcap",
        *(f"or: sonarhw scan '{url}' --out scan.mcap" for url in urls[1:]),
    ]


def test_guess_waits_for_a_sweep_a_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(text_device, "LISTEN", 0.05)  # less than between two lines
    monkeypatch.setattr(text_device, "LISTEN_MORE", 0.05)
    sweeps = (b"SCAN:" + b",".join(b"%d" % (110 + (k * 7 + n) % 150) for k in range(37)) + b"\r\n" for n in range(9999))
    with PrintingDevice(chain([b"Scanner ready: 0-180 deg, step 5\r\n"], slowly(sweeps))) as device:
        assert run(["ports", "--guess", device.port]) == 0
    printed = capsys.readouterr()
    assert "pattern=SCAN:[{range},]...&unit=cm'" in printed.out
    assert "such as 'SCAN:" in printed.out
    assert "&step=DEGREES' --out scan.mcap" in printed.err


def test_guess_leaves_a_pattern_open(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(text_device, "BAUDS", (9600,))
    angles = cycle([*range(0, 181, 3), *range(177, 0, -3)])
    lines = (b"angle:%d,left:%d,right:-1\n" % (a, 150 + a % 7) if a % 4 else b"" for a in angles)
    both = (b"angle:%d,left:%d,right:%d\n" % (a, 150 + a % 7, 90 + a * 5 % 11) for a in angles)
    with PrintingDevice(piece for pair in zip(lines, both, strict=True) for piece in pair) as device:
        assert run(["ports", "--guess", device.port]) == 0
    fields = "with {deg} and {cm} in place of the {-} of angle and range"
    pattern = f"write a pattern='angle:{{-}},left:{{-}},right:{{-}}' {fields}"
    assert pattern in capsys.readouterr().out


def slowly(pieces: Iterable[bytes]) -> Iterator[bytes]:
    """Yield pieces with pauses between them, in which other devices would be given up."""
    for piece in pieces:
        yield from (b"" for _ in range(200))
        yield piece


def test_a_scan_of_an_unknown_board_names_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "scan.mcap"
    with PrintingDevice(b"R%04d\r" % k for k in range(500, 5000)) as device:
        assert run(["scan", f"lines:{device.port}?preset=maxbotix&step=5", "--out", str(log)]) == 0
    err = capsys.readouterr().err
    assert "no angle is printed: the first reading of the scan is at angle 0; " in err
    assert f"board not stated: {read_log(log).metadata.board} recorded; " in err
    assert f"then: sonarhw compare {log} --room room.toml --board hc-sr04, or sonarhw gui {log} --room" in err


def test_guess_shows_other_text(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(text_device, "BAUDS", (9600,))
    monkeypatch.setattr(text_device, "LISTEN", 0.5)
    clock = ReceivedClock(monkeypatch, 500)
    monkeypatch.setattr(text_device, "time", clock)
    with PrintingDevice(b"humidity 41 percent\r\n" for _ in range(10**6)) as device:
        assert run(["ports", "--guess", device.port]) == 0
        assert "no preset matches, such as 'humidity 41 percent'; " in capsys.readouterr().out
    clock.enough = 0
    with PrintingDevice([]) as device:
        assert run(["ports", "--guess", device.port]) == 0
        assert capsys.readouterr().out == f"{device.port}  prints nothing\n"
    assert run(["ports", "--guess", "/dev/ttyUSB9"]) == 0
    assert "there is no such port" in capsys.readouterr().out


def test_guess_listens_at_likely_ports(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("sonarhw.link.serial_ports", lambda: [Port("/dev/ttyS0", "16550")])
    assert run(["ports", "--guess"]) == 0
    assert capsys.readouterr().out == "/dev/ttyS0  16550  not checked; name the port\n"
    assert run(["ports", "--guess", "--ask"]) == 2


SLOW = r"(?P<heading_deg>(\d+)+),(?P<range_cm>\d+)"


def test_a_match_that_takes_too_long_skips_its_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    url, log = f"?pattern={quote(SLOW)}", tmp_path / "scan.mcap"
    slow = [b"1" * 40 + b"\n"]  # in the sweep down and in the sweep up: either may be the first whole one
    pieces = [*RADAR_LINES[:5], *slow, *RADAR_LINES[5:15], *slow, *RADAR_LINES[15:]] * 4
    with PrintingDevice(pieces) as device:
        assert run(["scan", f"lines:{device.port}{url}", "--out", str(log)]) == 0
    assert "lines that take more than 1 s to match (" in capsys.readouterr().err
    assert len(read_log(log).readings) == 10
    with PrintingDevice(chain(RADAR_LINES * 2, repeat(*slow))) as device:
        assert run(["scan", f"lines:{device.port}{url}", "--out", str(tmp_path / "2.mcap"), "--sweeps", "9"]) == 2
    assert "write it without a repetition within a repetition" in capsys.readouterr().err


@pytest.mark.parametrize("device", ["text", "frames"])
def test_a_scan_whose_log_is_deleted_goes_on(device: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    log = tmp_path / "scan.mcap"
    with PrintingDevice(RADAR.rounds()) as printing, serve(FakeBoard(PlainEchoes()), tcp="127.0.0.1:0") as endpoint:
        url = f"lines:{printing.port}?preset=arduino-radar" if device == "text" else endpoint.url
        with started("scan", url, "--out", log, "--print", "--sweeps", "2") as scanning:
            shown = lines(scanning, 10)
            log.unlink()
            # not `communicate`, which skips lines that `lines` has read ahead
            out, errors = scanning.stdout.read(), scanning.stderr.read()
            scanning.wait(HANG)
    (kept,) = (tmp_path / "data").rglob("*.mcap")
    assert scanning.returncode == 0, errors
    assert f"the recording continues in {kept}, with all readings so far" in errors
    assert f"in {kept}\n" in errors
    assert len(read_log(kept).readings) == len(shown) + len(out.splitlines()) - 1
    assert not log.exists()
