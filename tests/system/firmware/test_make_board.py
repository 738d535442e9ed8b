"""`make board`: a process that prints a URL, behind which the firmware answers, and that leaves nothing behind."""

import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from sonarhw import Scanner

WITHIN = 10.0  # s


@pytest.fixture
def board(built: Path, tmp_path: Path) -> Iterator["subprocess.Popen[str]"]:
    """The process, behind a link."""
    entry = "from sonarhw_cli.entry import main; main()"
    command = [sys.executable, "-c", entry, "board", "--pty", str(tmp_path / "scanner")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        yield process
        process.kill()


def gone(link: Path) -> bool:
    """Whether the link is away in time."""
    deadline = time.monotonic() + WITHIN
    while link.is_symlink() and time.monotonic() < deadline:
        pass
    return not link.is_symlink()


def test_its_first_line_is_a_url_and_sigterm_ends_it_with_nothing_left(
    board: "subprocess.Popen[str]", tmp_path: Path
) -> None:
    assert board.stdout is not None
    url = board.stdout.readline().strip()
    assert url == str(tmp_path / "scanner")
    with Scanner.open(url) as scanner:
        assert scanner.info.firmware.startswith("sonarhw-mega")
        assert scanner.info.board == "polaroid-6500"
    board.send_signal(signal.SIGTERM)
    board.wait(WITHIN)
    assert gone(tmp_path / "scanner")
    assert board.stdout.read() == ""


def test_a_board_whose_owner_is_killed_ends_too(board: "subprocess.Popen[str]", tmp_path: Path) -> None:
    assert board.stdout is not None
    terminal = Path(board.stdout.readline().strip()).resolve()
    board.kill()
    board.wait(WITHIN)
    deadline = time.monotonic() + WITHIN
    while terminal.exists():
        assert time.monotonic() < deadline
