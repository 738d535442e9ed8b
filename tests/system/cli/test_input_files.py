"""Rooms, boards, logs, tables and studies that are folders, pipes, devices or huge files are refused before reading."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from sonarhw_cli.app import run
from sonarhw_sim.files import MOST_BYTES

from tests.fixtures.example_logs import write_example
from tests.hang_guard import HANG

SIMPLE = "rooms/simple.toml"


def huge(path: Path) -> None:
    """Create a file of 1 TB that needs no space."""
    with path.open("wb") as file:
        file.truncate(10**12)


KINDS: dict[str, Callable[[Path], object]] = {
    "folder": Path.mkdir,
    "pipe": os.mkfifo,
    "device": lambda path: path.symlink_to("/dev/zero"),
}
TOML_COMMANDS = {
    "room": ["simulate", "{}", "--place", "figure9"],
    "board": ["simulate", SIMPLE, "--place", "figure9", "--board", "{}"],
    "room of a log": ["compare", "{log}", "--room", "{}"],
    "room of a URL": ["scan", "fake:{}?place=figure9", "--out", "{out}"],
    "board of a URL": ["scan", f"fake:{SIMPLE}?place=figure9&board={{}}", "--out", "{out}"],
    "study": ["study", "{}", "--out", "{out}"],
}


def refusal(arguments: list[str], given: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """Return the error line of a command that is refused and writes nothing."""
    log, out = given.parent / "log.mcap", given.parent / "out.mcap"
    write_example(log, 4)
    assert run([part.format(given, log=log, out=out) for part in arguments]) == 2
    printed, error = capsys.readouterr()
    assert (printed, error.count("\n")) == ("", 1)
    assert not out.exists()
    return error


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", TOML_COMMANDS)
def test_a_toml_file_must_be_a_regular_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, kind: str
) -> None:
    given = tmp_path / "given.toml"
    KINDS[kind](given)
    error = refusal(TOML_COMMANDS[name], given, capsys)
    expected = {"folder": "Is a directory", "pipe": "it is a named pipe", "device": "it is a device"}[kind]
    assert f"{given}: cannot be read as a " in error
    assert expected in error


@pytest.mark.parametrize("name", TOML_COMMANDS)
def test_a_huge_toml_file_is_refused_with_the_limit(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    given = tmp_path / "given.toml"
    huge(given)
    error = refusal(TOML_COMMANDS[name], given, capsys)
    assert f"{given}: is larger than {MOST_BYTES / 2**20:g} MiB" in error


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "arguments",
    [["log", "info", "{}"], ["compare", "{}"], ["gui", "{}"], ["scan", "{}", "--out", "{out}"], ["replay", "{}"]],
    ids=lambda arguments: arguments[0],
)
def test_a_log_must_be_a_regular_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], kind: str
) -> None:
    given = tmp_path / "given.mcap"
    KINDS[kind](given)
    expected = "is a folder" if kind == "folder" else "is not a file"
    assert f"{given}: {expected}; give the name of a log" in refusal(arguments, given, capsys)


@pytest.mark.parametrize("kind", ["pipe", "device"])
@pytest.mark.parametrize("suffix", ["csv", "log", "bin", "bag", "wav", "npy", "mat"])
def test_a_foreign_scan_must_be_a_regular_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], suffix: str, kind: str
) -> None:
    given = tmp_path / f"given.{suffix}"
    KINDS[kind](given)
    options = {"csv": ["--heading", "deg", "--range", "m"], "npy": ["--rate", "1e5"], "mat": ["--rate", "1e5"]}
    error = refusal(["import", "{}", *options.get(suffix, []), "--out", "{out}"], given, capsys)
    expected = {"pipe": "it is a named pipe, not a file", "device": "it is a device, not a file"}[kind]
    assert f"{given}: cannot be read: {expected}; expected a" in error


def test_a_folder_without_a_bag_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    expected = "is a folder without metadata.yaml; give a file, or the folder of a bag of ROS 2"
    given = tmp_path / "given"
    given.mkdir()
    assert f"{given}: {expected}" in refusal(["import", "{}", "--out", "{out}"], given, capsys)


def test_a_bag_of_several_files_has_no_device(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = tmp_path / "given"
    given.mkdir()
    (given / "metadata.yaml").write_text("")
    (given / "bag.db3").symlink_to("/dev/zero")
    assert "it is a device, not a file" in refusal(["import", "{}", "--out", "{out}"], given, capsys)


def test_a_room_may_come_from_a_pipe_of_the_shell() -> None:
    shell = f"{sys.executable} -m sonarhw room check <(cat {SIMPLE})"
    done = subprocess.run(["bash", "-c", shell], capture_output=True, text=True, timeout=HANG, check=False)
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
