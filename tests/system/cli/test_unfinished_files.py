"""A signal while a file is being written leaves the old file or none, and no hidden file."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from sonarhw_cli.entry import INTERRUPTED

from tests.checkout import CHECKOUT
from tests.fixtures.example_logs import write_example
from tests.hang_guard import HANG

# a command that prints a line when all of its file is written but not yet renamed, and then waits
WAITING = """
import os, signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # also in the background
def wait(_):
    try:
        os.write(1, b"begun\\n")
        {}
    except BaseException:
        {}
os.fsync = wait
import sonarhw_cli.entry
sonarhw_cli.entry.main()
"""
SLEEPING = ("time.sleep(600)", "raise")
# the first signal is swallowed, as by some libraries
SWALLOWING = (
    "time.sleep(600)",
    'os.write(1, b"swallowed\\n"); sonarhw_cli.entry.UNWINDING = 600; time.sleep(600)',
)
HANGING_UP = ("os.kill(os.getpid(), signal.SIGHUP)", "raise")
OLD = b"older"
COMMANDS = {
    "csv": ["log", "export", "source.mcap", "--out", "new/scan.csv"],
    "export": ["log", "export", "source.mcap", "--out", "new/scan.mcap"],
    "recover": ["log", "recover", "source.mcap", "--out", "new/scan.mcap"],
    "import": ["import", "own.csv", "--heading", "deg", "--range", "m", "--out", "new/scan.mcap"],
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a log, a table, and an empty folder `new`."""
    write_example(tmp_path / "source.mcap", 4)
    (tmp_path / "own.csv").write_text("deg,m\n0,1\n5,1\n")
    (tmp_path / "new").mkdir()
    return tmp_path


def started(folder: Path, code: tuple[str, str], *arguments: str) -> "subprocess.Popen[str]":
    """Start a command, and return it when it waits in the middle of writing."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(CHECKOUT), os.environ.get("PYTHONPATH", "")])}
    process = subprocess.Popen(
        [sys.executable, "-c", WAITING.format(*code), *arguments],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == "begun\n"
    return process


@pytest.mark.parametrize(
    ("name", "number"),
    [*((name, signal.SIGINT) for name in COMMANDS), ("export", signal.SIGTERM), ("export", signal.SIGHUP)],
)
def test_a_signal_leaves_the_old_file_and_no_hidden_one(folder: Path, name: str, number: signal.Signals) -> None:
    out = folder / COMMANDS[name][-1]
    out.write_bytes(OLD)
    with started(folder, SLEEPING, *COMMANDS[name], "--force") as process:
        assert len([*out.parent.iterdir()]) == 2
        process.send_signal(number)
        assert process.communicate(timeout=HANG) == ("", "")
    assert process.returncode == INTERRUPTED
    assert {path.name: path.read_bytes() for path in out.parent.iterdir()} == {out.name: OLD}


def test_sigkill_leaves_the_old_file(folder: Path) -> None:
    out = folder / COMMANDS["export"][-1]
    out.write_bytes(OLD)
    with started(folder, SLEEPING, *COMMANDS["export"], "--force") as process:
        process.kill()
    assert out.read_bytes() == OLD


def test_sigkill_leaves_no_half_file(folder: Path) -> None:
    with started(folder, SLEEPING, *COMMANDS["export"]) as process:
        process.kill()
    assert not (folder / "new" / "scan.mcap").exists()


def test_a_second_signal_leaves_no_hidden_file_even_if_a_library_swallows_the_first(folder: Path) -> None:
    with started(folder, SWALLOWING, *COMMANDS["export"]) as process:
        process.send_signal(signal.SIGTERM)
        assert process.stdout.readline() == "swallowed\n"
        process.send_signal(signal.SIGTERM)
        process.wait(timeout=HANG)
    assert process.returncode == INTERRUPTED
    assert [*(folder / "new").iterdir()] == []


def test_a_hangup_that_nohup_ignores_is_ignored(folder: Path) -> None:
    ignoring = f"import signal; signal.signal(signal.SIGHUP, signal.SIG_IGN)\n{WAITING.format(*HANGING_UP)}"
    done = subprocess.run([sys.executable, "-c", ignoring, *COMMANDS["export"]], cwd=folder, check=False)
    assert done.returncode == 0
    assert [path.name for path in (folder / "new").iterdir()] == ["scan.mcap"]
