"""`sonarhw log` and `sonarhw replay`: torn and damaged logs, arrays, documented keys, and a replay over TCP."""

import signal
from pathlib import Path

import numpy as np
import pytest

from sonarhw.log import read_log
from tests.fixtures.commands import end, lines, printed, printed_json, sonarhw, started
from tests.fixtures.example_logs import assert_readings_close, example_reading, write_example
from tests.reference_pages import keys_in_reference, section

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


def test_export_of_a_torn_log_gives_a_warning_and_all_whole_readings(torn: Path) -> None:
    done = sonarhw("log", "export", torn, "--out", "-")
    assert (done.returncode, done.stdout) == (0, "".join(GOLDEN.splitlines(keepends=True)[:4]))
    end = f"the file ends too early at byte {torn.stat().st_size}"
    repair = "; to repair it: `sonarhw log recover LOG --out FILE.mcap`\n"
    assert done.stderr.startswith(f"sonarhw: warning: {torn}: torn; 3 whole readings read; {end}")
    assert done.stderr.endswith(repair)
    assert done.stderr.count("\n") == 1


def test_export_writes_arrays_and_logs_with_the_same_readings(log: Path, tmp_path: Path) -> None:
    assert printed("log", "export", log, "--out", "-") == GOLDEN
    printed("log", "export", log, "--out", tmp_path / "copy.mcap")
    copy, original = read_log(tmp_path / "copy.mcap"), read_log(log)
    assert (copy.readings, copy.metadata) == (original.readings, original.metadata)
    write_example(tmp_path / "traces.mcap", 4, trace=True)
    printed("log", "export", tmp_path / "traces.mcap", "--out", tmp_path / "scan.npz")
    with np.load(tmp_path / "scan.npz") as arrays:
        assert arrays["heading_deg"] == pytest.approx([0, 5, 10, 15])
        assert arrays["time_s"] == pytest.approx([0, 0.1, 0.2, 0.3])
        assert arrays["range_m"] == pytest.approx([0.343987, 0.345706935, np.nan, 0.349146805], nan_ok=True, abs=2e-7)
        assert arrays["echoes_s"].shape == (4, 2)
        assert np.isnan(arrays["echoes_s"][2]).all()
        assert arrays["traces"].shape == (4, 600)
        assert arrays["trace_rate_hz"] == pytest.approx([50_000] * 4)


def test_recover_prints_what_was_lost(torn: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recovered = tmp_path / "recovered.mcap"
    text = printed("log", "recover", torn, "--out", recovered)
    lost = "3 readings in 1 scan; 1 of 4 readings is missing"
    assert text.startswith(f"{recovered}: {lost}; {torn} was torn: the file ends too early at")
    assert read_log(recovered).torn is None
    assert len(read_log(recovered).readings) == 3
    again = printed("log", "recover", recovered, "--out", tmp_path / "again.mcap")
    assert f"; nothing was lost, {recovered} was whole" in again
    text = printed("log", "info", recovered)
    assert "3 of 4 readings, 2 with an echo" in text
    assert "; the scan was not finished\n" in text
    monkeypatch.setattr("sonarhw.log.reader.LATEST", read_log(recovered).metadata.started)
    clamped = sonarhw("log", "recover", recovered, "--out", tmp_path / "clamped.mcap").stderr
    assert " times are impossible, and replaced by the time before" in clamped
    assert len(read_log(tmp_path / "clamped.mcap").readings) == 3


def test_recover_continues_after_a_damaged_part(tmp_path: Path) -> None:
    damaged, recovered = tmp_path / "damaged.mcap", tmp_path / "recovered.mcap"
    write_example(damaged, 50, trace=True)
    with damaged.open("r+b") as file:
        file.seek(damaged.stat().st_size // 2)
        file.write(bytes(4096))
    text = printed("log", "recover", damaged, "--out", recovered)
    kept = read_log(recovered)
    assert kept.torn is None
    missing = 50 - len(kept.readings)
    assert 1 <= missing <= 6
    assert {0, 49} < {reading.number for reading in kept.readings}
    assert f"{missing} of 50 readings are missing; {damaged} was damaged: the record that begins at byte" in text
    for reading in kept.readings:
        assert_readings_close(reading, example_reading(reading.number, trace=True))
    info = sonarhw("log", "info", damaged)
    assert "file      damaged: the record" in info.stdout
    assert f"scan 1    {50 - missing} of 50 readings" in info.stdout
    assert info.stderr.startswith(f"sonarhw: warning: {damaged}: damaged; {50 - missing} whole readings read; ")


def test_info_as_json_has_the_documented_keys(log: Path) -> None:
    found, heading = printed_json("log", "info", log), "### `sonarhw log info"
    assert set(found) == keys_in_reference(heading)
    described = section("command_line.md", heading)
    assert [key for key in (*found["scans"][0], *found["device"]) if f"`{key}`" not in described] == []


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
