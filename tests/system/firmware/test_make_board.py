"""`make board` prints the URL of a board that runs the firmware, and leaves nothing behind."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from sonarhw import Scanner
from tests.hang_guard import HANG, wait_until


@pytest.fixture
def board(built: Path, tmp_path: Path) -> Iterator["subprocess.Popen[str]"]:
    """The process, with a link to its pseudo-terminal."""
    entry = "from sonarhw_cli.entry import main; main()"
    command = [sys.executable, "-c", entry, "board", "--pty", str(tmp_path / "scanner")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        yield process
        process.kill()


def test_its_first_line_is_a_url_and_sigterm_ends_it_cleanly(board: "subprocess.Popen[str]", tmp_path: Path) -> None:
    url = board.stdout.readline().strip()
    assert url == str(tmp_path / "scanner")
    with Scanner.open(url) as scanner:
        assert scanner.info.firmware.startswith("sonarhw-mega")
        assert scanner.info.board == "polaroid-6500"
    board.send_signal(signal.SIGTERM)
    board.wait(HANG)
    wait_until(lambda: not (tmp_path / "scanner").is_symlink())
    assert board.stdout.read() == ""


def test_the_emulator_ends_if_its_parent_is_killed(board: "subprocess.Popen[str]", tmp_path: Path) -> None:
    terminal = Path(board.stdout.readline().strip()).resolve()
    board.kill()
    board.wait(HANG)
    wait_until(lambda: not terminal.exists())
