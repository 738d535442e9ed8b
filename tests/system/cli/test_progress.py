"""The progress bar of long work: shown on a terminal and removed at the end, not written to a pipe."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from io import StringIO
from pathlib import Path

import pytest
from sonarhw_cli.app import run
from sonarhw_cli.entry import INTERRUPTED
from sonarhw_cli.outputs import CompilationProgress, progress_of_share

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
    """A predicted scan of the simple room, by a board that hears only loud echoes, so searches are quick."""
    out = tmp_path_factory.mktemp("progress") / "scan.mcap"
    scan = ["simulate", "rooms/simple.toml", "--place", "figure9", "--board", "hc-sr04", "--step", "30"]
    assert run([*scan, "--out", str(out)]) == 0
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


def test_progress_is_shown_on_a_terminal_and_output_equals_that_to_a_pipe(
    log: str, capsys: pytest.CaptureFixture[str]
) -> None:
    doing, (command, *options) = COMMANDS["compare"]
    with at_terminal(command, log, *options) as (process, person):
        on_terminal = seen(person)
        printed, _ = process.communicate(timeout=HANG)
    assert process.returncode == 0
    assert doing in on_terminal
    assert BAR in on_terminal

    assert run([command, log, *options]) == 0
    in_pipe = capsys.readouterr()
    assert printed == in_pipe.out
    _, gone, after = on_terminal.rpartition(LINE_GONE)
    assert gone
    assert after == in_pipe.err.replace("\n", "\r\n")


@pytest.mark.parametrize("name", sorted(COMMANDS.keys() - {"compare"}))  # the test above shows that of compare
def test_every_long_command_shows_its_progress(name: str, log: str, monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = fake_terminal(monkeypatch)
    doing, (command, *options) = COMMANDS[name]
    assert run([command, log, *options]) == 0
    assert doing in terminal.getvalue()
    assert BAR in terminal.getvalue()


def fake_terminal(monkeypatch: pytest.MonkeyPatch) -> StringIO:
    """Replace standard error of this process by a terminal, and return what is shown there."""
    terminal = StringIO()
    monkeypatch.setattr(terminal, "isatty", lambda: True)
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    return terminal


def test_the_first_command_says_that_it_compiles_and_the_second_does_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    command = ["simulate", "rooms/simple.toml", "--place", "figure9", "--model", "cone", "--step", "90"]
    on_terminal = []
    for _ in range(2):
        with at_terminal(*command) as (process, person):
            on_terminal.append(seen(person))
            printed, _ = process.communicate(timeout=HANG)
        assert process.returncode == 0
        assert printed.count("\n") == 5
    assert "Compiling the ray kernels, once per installation…" in on_terminal[0]
    assert BAR in on_terminal[0]
    assert on_terminal[0].endswith(LINE_GONE)
    assert on_terminal[1] == ""


def test_without_a_terminal_few_lines_say_that_it_compiles(capsys: pytest.CaptureFixture[str]) -> None:
    shown = CompilationProgress()
    for done in range(30):
        shown.compiling(done, 50)
        shown.compiled()
    line = "sonarhw: Compiling the ray kernels, once per installation…"
    assert capsys.readouterr().err == f"{line}\n{line} 20 of 50\n"


def test_compilation_during_other_work_replaces_its_word(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = fake_terminal(monkeypatch)
    shown = CompilationProgress()
    with progress_of_share() as show:
        show(0.25, "searching")
        shown.compiling(0, 5)
        show(0.25, "still searching")
        shown.compiled()
        show(0.5, "refining")
    text = terminal.getvalue()
    assert "Compiling the ray kernels" in text
    assert "still searching" not in text
    assert "refining" in text
    assert "0/5" not in text
    assert text.endswith(LINE_GONE.replace("\r", "\r"))


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
