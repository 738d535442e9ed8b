"""`sonarhw log` and `sonarhw replay`: output, messages and refused input."""

import json
import os
import signal
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pytest
from mcap.writer import MCAP0_MAGIC, Writer
from sonarhw_cli.app import run
from sonarhw_gui.jobs.files import save_file, write_data
from sonarhw_gui.model.scene import scene_with
from sonarhw_sim.board.profile import load_board

from sonarhw import export
from sonarhw.log import Log, read_log
from tests.fixtures.example_logs import assert_readings_close, example_reading, write_example
from tests.reference_pages import keys_in_reference, section
from tests.system.cli.instrument.test_scan_command import end, lines, sonarhw, started

GOLDEN = """\
time_s,heading_deg,range_m,echoes_s
0,0,0.343987,0.002;0.0111
0.1,5,0.345706935,0.00201;0.0111
0.2,10,,
0.3,15,0.349146805,0.00203;0.0111
"""


@pytest.fixture
def log(tmp_path: Path) -> Path:
    write_example(tmp_path / "scan.mcap", 4)
    return tmp_path / "scan.mcap"


@pytest.fixture
def torn(log: Path, tmp_path: Path) -> Path:
    whole = log.read_bytes()
    path = tmp_path / "torn.mcap"
    for size in range(len(whole), 0, -50):
        path.write_bytes(whole[:size])
        if len(read_log(path).readings) == 3:
            return path
    raise AssertionError


def test_export_writes_the_same_csv_as_scan_prints(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["log", "export", str(log), "--out", "-"]) == 0
    assert capsys.readouterr() == (GOLDEN, "")
    assert run(["log", "export", str(log), "--out", str(tmp_path / "scan.csv")]) == 0
    assert (tmp_path / "scan.csv").read_bytes() == GOLDEN.encode()


def test_export_of_a_torn_log_gives_a_warning_and_all_whole_readings(
    torn: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["log", "export", str(torn), "--out", "-"]) == 0
    out, err = capsys.readouterr()
    assert out == "".join(GOLDEN.splitlines(keepends=True)[:4])
    assert err.count("\n") == 1
    size = torn.stat().st_size
    warning = f"sonarhw: warning: {torn}: torn; 3 whole readings read; the file ends too early at byte {size}"
    assert err.startswith(warning)
    assert err.endswith("; to repair it: `sonarhw log recover LOG --out FILE.mcap`\n")


def test_export_writes_arrays(log: Path, tmp_path: Path) -> None:
    write_example(tmp_path / "traces.mcap", 4, trace=True)
    assert run(["log", "export", str(tmp_path / "traces.mcap"), "--out", str(tmp_path / "scan.npz")]) == 0
    with np.load(tmp_path / "scan.npz") as arrays:
        assert arrays["heading_deg"] == pytest.approx([0, 5, 10, 15])
        assert arrays["time_s"] == pytest.approx([0, 0.1, 0.2, 0.3])
        assert arrays["range_m"] == pytest.approx([0.343987, 0.345706935, np.nan, 0.349146805], nan_ok=True, abs=2e-7)
        assert arrays["echoes_s"].shape == (4, 2)
        assert np.isnan(arrays["echoes_s"][2]).all()
        assert arrays["traces"].shape == (4, 600)
        assert arrays["trace_rate_hz"] == pytest.approx([50_000] * 4)


def test_export_to_mcap_writes_a_log_with_the_same_readings(log: Path, tmp_path: Path) -> None:
    assert run(["log", "export", str(log), "--out", str(tmp_path / "copy.mcap")]) == 0
    copy, original = read_log(tmp_path / "copy.mcap"), read_log(log)
    assert copy.readings == original.readings
    assert copy.metadata == original.metadata


@pytest.mark.parametrize("command", ["export", "recover"])
def test_an_existing_file_is_refused_without_force(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    out = tmp_path / "out.mcap"
    out.write_text("mine")
    assert run(["log", command, str(log), "--out", str(out)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert out.read_text() == "mine"
    assert run(["log", command, str(log), "--out", str(out), "--force"]) == 0
    assert len(read_log(out).readings) == 4


@pytest.mark.parametrize("command", ["export", "recover"])
def test_a_log_is_never_overwritten_by_its_own_copy(
    log: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    before = log.read_bytes()
    assert run(["log", command, str(log), "--out", str(log), "--force"]) == 2
    assert "is the input file" in capsys.readouterr().err
    assert log.read_bytes() == before


def test_recover_repairs_a_torn_log_and_prints_what_was_lost(
    torn: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recovered = tmp_path / "recovered.mcap"
    assert run(["log", "recover", str(torn), "--out", str(recovered)]) == 0
    out, err = capsys.readouterr()
    message = (
        f"{recovered}: 3 readings in 1 scan; 1 of 4 readings is missing; {torn} was torn: the file ends too early at"
    )
    assert out.startswith(message)
    assert err == ""
    assert read_log(recovered).torn is None
    assert len(read_log(recovered).readings) == 3
    assert run(["log", "recover", str(recovered), "--out", str(tmp_path / "again.mcap")]) == 0
    assert f"; nothing was lost, {recovered} was whole" in capsys.readouterr().out


def test_recover_continues_after_a_damaged_part(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    damaged, recovered = tmp_path / "damaged.mcap", tmp_path / "recovered.mcap"
    write_example(damaged, 50, trace=True)
    with damaged.open("r+b") as file:
        file.seek(damaged.stat().st_size // 2)
        file.write(bytes(4096))
    assert run(["log", "recover", str(damaged), "--out", str(recovered)]) == 0
    printed = capsys.readouterr().out
    kept = read_log(recovered)
    assert kept.torn is None
    missing = 50 - len(kept.readings)
    assert 1 <= missing <= 6
    assert {0, 49} < {reading.number for reading in kept.readings}
    assert f"{missing} of 50 readings are missing; {damaged} was damaged: the record that begins at byte" in printed
    for reading in kept.readings:
        assert_readings_close(reading, example_reading(reading.number, trace=True))
    assert run(["log", "info", str(damaged)]) == 0
    out, err = capsys.readouterr()
    assert "file      damaged: the record" in out
    assert f"scan 1    {50 - missing} of 50 readings" in out
    assert err.startswith(f"sonarhw: warning: {damaged}: damaged; {50 - missing} whole readings read; ")


def test_info_prints_origin_and_contents_of_a_log(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["log", "info", str(log)]) == 0
    printed = capsys.readouterr().out
    for text in (
        "simulate, sonarhw",
        "simple.toml",
        "figure9",
        "paper",
        "4 of 4 readings, 3 with an echo",
        "0° to 15°",
    ):
        assert text in printed


def test_info_as_json_has_the_documented_keys(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["log", "info", str(log), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    (scan,) = found["scans"]
    assert {key: found[key] for key in ("file", "origin", "made_by", "place", "board", "condition", "damage")} == {
        "file": str(log),
        "origin": "simulated",
        "made_by": "simulate",
        "place": "figure9",
        "board": "paper",
        "condition": "whole",
        "damage": None,
    }
    assert (scan["readings"], scan["echoes"], scan["highest_angle_deg"], scan["finished"]) == (4, 3, 15.0, True)
    heading = "### `sonarhw log info"
    assert set(found) == keys_in_reference(heading)
    described = section("command_line.md", heading)
    assert [key for key in (*scan, *found["device"]) if f"`{key}`" not in described] == []


def test_info_of_a_log_without_metadata_prints_an_unknown_date(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = log.read_bytes()
    (tmp_path / "torn.mcap").write_bytes(data[: 8 + 9 + int.from_bytes(data[9:17], "little")])
    assert run(["log", "recover", str(tmp_path / "torn.mcap"), "--out", str(tmp_path / "recovered.mcap")]) == 0
    assert "0 readings in 0 scans; no reading is known to be missing" in capsys.readouterr().out
    for name, state in (("torn.mcap", "torn: the file ends too early at byte"), ("recovered.mcap", "whole")):
        assert run(["log", "info", str(tmp_path / name)]) == 0
        printed = dict(
            line.split(maxsplit=1) for line in capsys.readouterr().out.replace("made by", "made_by").splitlines()
        )
        assert (printed["made_by"], printed["started"], printed["readings"]) == ("unknown", "unknown", "none")
        assert printed["file"].startswith(state)


def test_info_of_an_unfinished_scan_reports_a_whole_file(
    torn: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["log", "recover", str(torn), "--out", str(tmp_path / "recovered.mcap")]) == 0
    capsys.readouterr()
    assert run(["log", "info", str(tmp_path / "recovered.mcap")]) == 0
    printed = capsys.readouterr().out
    assert "3 of 4 readings, 2 with an echo" in printed
    assert "; the scan was not finished\n" in printed
    assert "file      whole\n" in printed


def test_a_single_reading_is_counted_in_the_singular(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_example(tmp_path / "scan.mcap", 1)
    assert run(["log", "info", str(tmp_path / "scan.mcap")]) == 0
    assert "1 of 1 reading, 1 with an echo" in capsys.readouterr().out
    assert run(["compare", str(tmp_path / "scan.mcap"), "--room", "rooms/simple.toml"]) == 0
    assert "\n1 simulated reading, 1 with an echo: " in capsys.readouterr().out


def another_programs_mcap(path: Path) -> None:
    writer = Writer(str(path))
    writer.start("ros2")
    writer.finish()


@pytest.mark.parametrize(
    "command",
    [
        ["log", "info"],
        ["log", "export", "--out", "-"],
        ["log", "recover", "--out", "recovered.mcap"],
        ["replay"],
        ["compare"],
    ],
    ids=" ".join,
)
@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda path: None, "no such file"),
        (Path.mkdir, "is a folder"),
        (os.mkfifo, "is not a file"),
        (lambda path: path.write_bytes(b""), "is empty"),
        (lambda path: path.write_bytes(b"time_s\n"), "is not an MCAP file"),
        (another_programs_mcap, "is an MCAP file, but not a log of sonarhw"),
        (lambda path: path.write_bytes(MCAP0_MAGIC + bytes(100)), "its header is damaged"),
    ],
)
def test_a_file_that_is_not_a_log_gives_an_error_of_one_line(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    command: list[str],
    make: Callable[[Path], object],
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    make(Path("scan.mcap"))
    assert run([*command, "scan.mcap"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("sonarhw: scan.mcap: ")
    assert message in err
    assert err.count("\n") == 1
    assert not Path("recovered.mcap").exists()


def test_an_export_in_an_unknown_format_is_refused(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["log", "export", str(log), "--out", str(tmp_path / "scan.txt")]) == 2
    assert f"{', '.join(export.export_suffixes())} or .mcap, or - for" in capsys.readouterr().err
    assert not (tmp_path / "scan.txt").exists()


def test_a_format_is_added_in_one_place(log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def write_count(log: Log, file: BinaryIO, notes: Mapping[int, str]) -> None:
        file.write(str(len(log.readings)).encode())

    added = (*export.FORMATS, export.ExportFormat(".count", "How many readings", write_count))
    monkeypatch.setattr(export, "FORMATS", added)
    assert run(["log", "export", str(log), "--out", str(tmp_path / "command.count")]) == 0
    endings = export.export_suffixes()
    write = partial(write_data, log, scene_with(load_board("polaroid-6500")), (), ".count")
    save_file(write, endings, tmp_path / "window.count", overwrite=False)
    assert (tmp_path / "command.count").read_text() == (tmp_path / "window.count").read_text() == "4"


def test_a_scan_of_a_replay_over_tcp_equals_the_log(log: Path, tmp_path: Path) -> None:
    again = tmp_path / "again.mcap"
    with started("replay", log, "--speed", "inf", "--tcp", "127.0.0.1:0") as replay:
        (url,) = lines(replay, 1)
        done = sonarhw("scan", url.strip(), "--out", again, "--to", "20")
        assert (done.returncode, len(done.stderr.splitlines())) == (0, 1)
        replay.send_signal(signal.SIGTERM)
        assert end(replay) == (0, "")
    first, second = read_log(log), read_log(again)
    assert [reading.angle for reading in second.readings] == [reading.angle for reading in first.readings]
    assert [reading.echo_times for reading in second.readings] == [reading.echo_times for reading in first.readings]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--speed", "0"], "--speed 0"),
        (["--speed", "nan"], "--speed nan"),
        (["--tcp", "127.0.0.1:0", "--pty", "x"], "one line"),
        (["--tcp", "nowhere"], "HOST:PORT"),
    ],
)
def test_a_replay_with_wrong_options_is_refused(
    log: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert run(["replay", str(log), *arguments]) == 2
    assert message in capsys.readouterr().err
