"""The command `gui` from outside: signals, bad input at the door, and no display."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from cli.app import run
from sonarhw.log import read_log
from tests.gui.conftest import ROOM

SONARHW = [sys.executable, "-c", "from cli.entry import main; main()"]


def started(tmp_path: Path, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [*SONARHW, "gui", *arguments],
        env={**os.environ, "XDG_DATA_HOME": str(tmp_path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def told(tmp_path: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*SONARHW, "gui", *arguments],
        env={**os.environ, "XDG_DATA_HOME": str(tmp_path), **environment},
        capture_output=True,
        text=True,
        timeout=60,
    )


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_in_mid_scan_ends_it_clean(tmp_path: Path, number: int) -> None:
    room = tmp_path / "small.toml"
    room.write_text(ROOM.read_text())
    process = started(tmp_path, f"fake:{room}?place=figure9&pace=2")
    recordings = tmp_path / "sonarhw" / "recordings"
    deadline = time.monotonic() + 90
    while not any(path.stat().st_size > 20_000 for path in recordings.glob("*.mcap")):
        assert process.poll() is None, process.communicate()[1]
        assert time.monotonic() < deadline
        time.sleep(0.05)
    process.send_signal(number)
    _, complaints = process.communicate(timeout=60)
    assert process.returncode == 130
    assert complaints == ""
    (recording,) = recordings.glob("*.mcap")
    log = read_log(recording)
    assert log.torn is None
    assert log.readings


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nowhere.mcap"], "nowhere.mcap: there is no such file"),
        (["fake:nowhere.toml"], "nowhere.toml"),
        ([f"fake:{ROOM}?place=nowhere"], "no place 'nowhere'"),
        ([f"fake:{ROOM}?place=figure9&pace=never"], "pace never"),
        (["/dev/ttyNONE", "--place", "figure9"], "--place needs --room"),
        (["/dev/ttyNONE", "--board", "none"], "no board 'none'"),
    ],
)
def test_what_is_wrong_is_one_line_before_a_window_opens(
    arguments: list[str], said: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("DISPLAY", "")
    assert run(["gui", *arguments]) == 2
    complaints = capsys.readouterr().err
    assert said in complaints
    assert complaints.count("\n") == 1


@pytest.mark.parametrize("display", ["", ":4711"])
def test_without_a_display_it_says_so_and_what_to_do(tmp_path: Path, display: str) -> None:
    result = told(tmp_path, DISPLAY=display, WAYLAND_DISPLAY="", QT_QPA_PLATFORM="")
    assert result.returncode == 1
    assert "no display" in result.stderr
    assert "sonarhw demo --headless" in result.stderr
    assert result.stderr.count("\n") == 1
