"""The progress bar of long work: shown on a terminal and removed at the end, not written to a pipe."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from sonarhw_cli.app import run
from sonarhw_cli.entry import INTERRUPTED

from tests.checkout import CHECKOUT
from tests.hang_guard import HANG

ROOT = CHECKOUT
# standard error is the controlling terminal, from which Ctrl-C comes
AT_TERMINAL = """
import fcntl, os, termios
os.setsid()
fcntl.ioctl(2, termios.TIOCSCTTY, 0)
import sonarhw_cli.entry
sonarhw_cli.entry.main()
"""
BAR = "━"
PLAIN = "\x1b[0m"
LINE_GONE = "\x1b[?25h\r\x1b[1A\x1b[2K"  # show the cursor, move up one line, clear it
COMMANDS = {
    "fit": ("searching", ["fit", "--place", "figure9", "--free", "heading", "--samples", "0", "--json"]),
    "locate": ("locating", ["locate", "--json"]),
    "compare": ("fitting", ["compare", "--place", "figure9", "--fit", "heading"]),
    "map": ("mapping", ["map", "--place", "figure9", "--json"]),
}


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A predicted scan of the simple room."""
    out = tmp_path_factory.mktemp("progress") / "scan.mcap"
    assert run(["simulate", "rooms/simple.toml", "--place", "figure9", "--step", "30", "--out", str(out)]) == 0
    return str(out)


@contextmanager
def at_terminal(*arguments: str) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """Yield a command with a terminal as standard error, and the other end of that terminal."""
    person, terminal = os.openpty()
    environment = {**os.environ, "TERM": "xterm"}
    command = [sys.executable, "-c", AT_TERMINAL, *arguments]
    try:
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=terminal, text=True, cwd=ROOT, env=environment
        ) as process:
            os.close(terminal)
            try:
                yield process, person
            finally:
                process.kill()
    finally:
        os.close(person)


def seen(person: int, until: str = "") -> str:
    """Return the text on the terminal up to `until`, or to the end of the command."""
    came = b""
    while not until or until not in came.decode(errors="ignore"):
        try:
            more = os.read(person, 4096)
        except OSError:  # Linux reports a closed terminal in this way
            more = b""
        if not more:
            break
        came += more
    return came.decode()


@pytest.mark.parametrize("name", COMMANDS)
def test_progress_is_shown_on_a_terminal_and_output_equals_that_to_a_pipe(
    name: str, log: str, capsys: pytest.CaptureFixture[str]
) -> None:
    doing, (command, *options) = COMMANDS[name]
    with at_terminal(command, log, *options) as (process, person):
        on_terminal = seen(person)
        printed, _ = process.communicate(timeout=HANG)
    assert process.returncode == 0
    assert doing in on_terminal
    assert BAR in on_terminal
    assert on_terminal.endswith(LINE_GONE)

    assert run([command, log, *options]) == 0
    in_pipe = capsys.readouterr()
    assert printed == in_pipe.out
    assert in_pipe.err == ""


def test_ctrl_c_removes_the_progress_bar_and_ends_with_130(log: str) -> None:
    doing, (command, *options) = COMMANDS["fit"]
    with at_terminal(command, log, *options) as (process, person):
        seen(person, until=doing)
        os.write(person, b"\x03")
        shown = seen(person)
        printed, _ = process.communicate(timeout=HANG)
    assert process.returncode == INTERRUPTED
    assert printed == ""
    assert shown.removesuffix(PLAIN).endswith(LINE_GONE)
    assert "Traceback" not in shown
