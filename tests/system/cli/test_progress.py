"""The bar of long work: a person at a terminal sees how far it is, and nothing of it is left; a program sees none."""

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
# its standard error is the terminal that Ctrl-C comes from
AT_TERMINAL = """
import fcntl, os, termios
os.setsid()
fcntl.ioctl(2, termios.TIOCSCTTY, 0)
import sonarhw_cli.entry
sonarhw_cli.entry.main()
"""
BAR = "━"
PLAIN = "\x1b[0m"
LINE_GONE = "\x1b[?25h\r\x1b[1A\x1b[2K"  # the cursor shows again, one line up, that line empty
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
    """The command with a terminal as its standard error, and the end of that terminal where a person sits."""
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
    """What comes on the terminal until it says that, or the command has ended."""
    came = b""
    while not until or until not in came.decode(errors="ignore"):
        try:
            more = os.read(person, 4096)
        except OSError:  # how Linux says that nobody holds the other end
            more = b""
        if not more:
            break
        came += more
    return came.decode()


@pytest.mark.parametrize("name", COMMANDS)
def test_a_terminal_shows_how_far_the_work_is_and_what_is_printed_is_what_a_pipe_gets(
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


def test_ctrl_c_at_the_bar_takes_it_away_and_ends_with_130(log: str) -> None:
    doing, (command, *options) = COMMANDS["fit"]
    with at_terminal(command, log, *options) as (process, person):
        seen(person, until=doing)
        os.write(person, b"\x03")
        told = seen(person)
        printed, _ = process.communicate(timeout=HANG)
    assert process.returncode == INTERRUPTED
    assert printed == ""
    assert told.removesuffix(PLAIN).endswith(LINE_GONE)
    assert "Traceback" not in told
